# bash @MARK@: do not edit

_handctl_node() # PATH: what stands below it; sets cmds opts takes args
{
    local option lacks= shared=" "@SHARED@" "
    cmds='' opts='' takes='' args=''
    case $1 in
@NODES@
    esac
    for option in $lacks; do
        shared=${shared/" $option "/ }
    done
    opts+=$shared takes=" $takes "@SHARED_TAKES@
}

_handctl_map() # FAMILY: names of its quantities; sets read set name elements values
{
    case $1 in
@MAPS@
    esac
}

_handctl_readline() # HINT: how readline goes on; bash 3.2 of macOS takes no hint, and has its file names where nothing is offered
{
    type -t compopt >/dev/null && compopt -o "$1"
    return 0
}

_handctl_offer() # HEAD WORD...: those that continue what is typed, each after HEAD
{
    local head=$1 word
    shift
    for word; do
        [[ $head$word == "$cur"* ]] && COMPREPLY+=("$head$word")
    done
    return 0
}

_handctl_link() # HEAD
{
    local place value=${cur#"$1"}
    if [[ $value == replay:* ]]; then
        _handctl_readline default
        return
    fi
    _handctl_offer "$1" @PREFIXES@ @FAKES@
    for place in @PORTS@; do
        [[ -e $place ]] && _handctl_offer "$1" "$place"
    done
    for place in @INTERFACES@; do
        [[ -e $place ]] && _handctl_offer "$1can:socketcan:" "${place##*/}"
    done
    for place in @SLCAN@; do
        [[ -e $place && $value == can:slcan:* ]] && _handctl_offer "$1can:slcan:" "$place"
    done
    ((${#COMPREPLY[@]})) || _handctl_readline default
}

_handctl_devices() # HEAD: the tables [devices.NAME] of the configuration file
{
    local line file=${XDG_CONFIG_HOME:-$HOME/.config}/handctl/config.toml
    local table='^[[:space:]]*\[devices\."?([A-Za-z0-9_-]+)"?[].]'
    [[ -r $file ]] || return 0
    while IFS= read -r line || [[ $line ]]; do
        [[ $line =~ $table ]] && _handctl_offer "$1" "${BASH_REMATCH[1]}"
    done <"$file"
    return 0
}

_handctl_names() # read|set|name FAMILY: quantities, then their elements, then their values
{
    local read set name elements values list sign= base=${cur%%[.=]*}
    _handctl_map "$2"
    elements=" $elements" values=" $values"
    [[ $1 == set ]] && sign='='
    if [[ $sign && $cur == *=* ]]; then
        [[ $values == *" $base="* ]] || return 0
        list=${values#*" $base="}
        list=${list%% *}
        _handctl_offer "${cur%%=*}=" ${list//,/ }
        return
    fi
    if [[ $cur != *.* ]]; then
        _handctl_offer '' ${!1}
        ((${#COMPREPLY[@]} == 1)) || { COMPREPLY=("${COMPREPLY[@]/%/$sign}"); return; }
        base=${COMPREPLY[0]}
        COMPREPLY=("$base$sign")
    fi
    [[ $elements == *" $base="* && " ${!1} " == *" $base "* ]] || return 0
    list=${elements#*" $base="}
    list=${list%% *}
    list=" ${list//,/ }"
    for list in $list; do
        _handctl_offer '' "$base.$list$sign"
    done
}

_handctl_take() # TOKEN HEAD: what may stand in this place
{
    local detail=${1#*:}
    case $1 in
        choice:*) _handctl_offer "$2" ${detail//,/ } ;;
        read:* | set:* | name:*) _handctl_names "${1%%:*}" "$detail" ;;
        link) _handctl_link "$2" ;;
        device) _handctl_devices "$2" ;;
        file) _handctl_readline default ;;
        dir) _handctl_readline dirnames ;;
    esac
}

_handctl_words() # the words up to the cursor, with what readline splits at = and : put together; sets words cur
{
    local line=${COMP_LINE:0:COMP_POINT} rest index last
    words=()
    for ((index = 0; index <= COMP_CWORD; index++)); do
        rest=${line#"${line%%[![:space:]]*}"}
        last=${#words[@]}
        [[ $index -gt 0 && $rest == "$line" && ${COMP_WORDS[index]} ]] && ((last--))
        if ((index == COMP_CWORD)); then
            words[last]+=$rest
        else
            words[last]+=${COMP_WORDS[index]}
            line=${rest#"${COMP_WORDS[index]}"}
        fi
    done
    last=$((${#words[@]} - 1)) # bash 3.2 knows no words[-1]
    cur=${words[last]}
    unset "words[last]"
}

_handctl()
{
    local IFS=$' \t\n' cur words cmds opts takes args word flags path= pending= ends= count=0
    COMPREPLY=()
    _handctl_words
    _handctl_node ''
    for word in "${words[@]:1}"; do
        if [[ $pending ]]; then
            pending=
        elif [[ ! $ends && $word == -- ]]; then
            ends=yes
        elif [[ ! $ends && $word == --*=* ]]; then
            :
        elif [[ ! $ends && $word == -?* ]]; then
            flags=$word
            [[ $word == --* ]] || while [[ ${#flags} -gt 2 && $takes != *" ${flags:0:2}="* ]]; do
                flags=-${flags:2}
            done
            [[ $takes == *" $flags="* ]] && pending=${takes#*" $flags="} && pending=${pending%% *}
        elif [[ " $cmds " == *" $word "* ]]; then
            path+=${path:+ }$word
            _handctl_node "$path"
        elif [[ $word == *[\<\>]* ]]; then
            pending=file
        else
            ((count++))
        fi
    done
    if [[ $pending ]]; then
        _handctl_take "$pending" ''
    elif [[ ! $ends && $cur == --*=* ]]; then
        word=${cur%%=*}
        [[ $takes == *" $word="* ]] && pending=${takes#*" $word="} && _handctl_take "${pending%% *}" "$word="
    elif [[ ! $ends && $cur == -* ]]; then
        _handctl_offer '' $opts
    elif [[ $cmds ]]; then
        _handctl_offer '' $cmds
    elif [[ $args ]]; then
        args=($args)
        ((count < ${#args[@]})) || { count=$((${#args[@]} - 1)); [[ ${args[count]} == *'*' ]] || return 0; }
        _handctl_take "${args[count]%'*'}" ''
    fi
    if ((${#COMPREPLY[@]} == 1)); then
        if [[ ${COMPREPLY[0]} == *[=:/] ]]; then
            _handctl_readline nospace
        elif ! type -t compopt >/dev/null; then
            COMPREPLY=("${COMPREPLY[0]} ")
        fi
    fi
    # readline replaces only what follows the last of its word breaks
    word=
    [[ $COMP_WORDBREAKS == *=* && $cur == *=* ]] && word=${cur%"${cur##*=}"}
    [[ $COMP_WORDBREAKS == *:* && $cur == *:* && ${cur%"${cur##*:}"} == "$word"* ]] && word=${cur%"${cur##*:}"}
    [[ $word ]] && COMPREPLY=("${COMPREPLY[@]#"$word"}")
    return 0
}

if type -t compopt >/dev/null; then
    complete -F _handctl handctl handctl.pyz
else
    complete -o default -o nospace -F _handctl handctl handctl.pyz
fi
