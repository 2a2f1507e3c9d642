#compdef handctl handctl.pyz
# zsh @MARK@: do not edit

_handctl_node() { # PATH: what stands below it; sets cmds opts takes args
    local option
    local -a lacks shared=(@SHARED@)
    cmds=() opts=() takes=() args=()
    case $1 in
@NODES@
    esac
    for option in $lacks; do
        shared=(${shared:#$option:*})
    done
    opts+=($shared)
    takes=(@SHARED_TAKES@ ${(kv)takes})
}

_handctl_map() { # FAMILY: names of its quantities; sets read set name elements values
    case $1 in
@MAPS@
    esac
}

_handctl_link() {
    if compset -P 'replay:'; then
        _files
        return
    fi
    local -a ports=(@PORTS@) interfaces=(@INTERFACES@) slcan=(@SLCAN@)
    compadd -S '' -- @PREFIXES@
    compadd -- @FAKES@ $ports can:socketcan:$^interfaces can:slcan:$^slcan
    _files
}

_handctl_devices() { # the tables [devices.NAME] of the configuration file
    local file=${XDG_CONFIG_HOME:-$HOME/.config}/handctl/config.toml line
    local -a match mbegin mend found
    [[ -r $file ]] || return 1
    while IFS= read -r line || [[ -n $line ]]; do
        [[ $line =~ '^[[:space:]]*\[devices\."?([A-Za-z0-9_-]+)"?[].]' ]] && found+=($match[1])
    done <$file
    compadd -- $found
}

_handctl_names() { # read|set|name FAMILY: quantities, then their elements, then their values
    local -a read set name words
    local -A elements values
    local base=${PREFIX%%[.=]*} sign=
    _handctl_map $2
    [[ $1 == set ]] && sign='='
    if [[ -n $sign && $PREFIX == *=* ]]; then
        compset -P '*='
        compadd -- ${=values[$base]}
        return
    fi
    words=(${(P)1})
    if [[ $PREFIX == *.* ]]; then
        [[ -n ${(M)words:#$base(:*|)} ]] || return 1
        compadd -S "${sign:- }" -- $base.${^=elements[$base]}
        return
    fi
    words=(${(M)words:#$PREFIX*})
    _describe -t quantities quantity words -S "${sign:- }"
    base=${words[1]%%:*}
    [[ $#words -eq 1 && -n ${elements[$base]} ]] && compadd -S "${sign:- }" -- $base.${^=elements[$base]}
}

_handctl_take() { # TOKEN: what may stand in this place
    local detail=${1#*:}
    case $1 in
        (choice:*) compadd -- ${(s:,:)detail} ;;
        (read:*|set:*|name:*) _handctl_names ${1%%:*} $detail ;;
        (link) _handctl_link ;;
        (device) _handctl_devices ;;
        (file) _files ;;
        (dir) _files -/ ;;
    esac
}

_handctl() {
    emulate -L zsh
    setopt extended_glob
    local -a cmds opts args
    local -A takes
    local word flags where= pending= ends= count=0
    _handctl_node ''
    for word in ${words[2,CURRENT-1]}; do
        if [[ -n $pending ]]; then
            pending=
        elif [[ -z $ends && $word == -- ]]; then
            ends=yes
        elif [[ -z $ends && $word == --*=* ]]; then
            continue
        elif [[ -z $ends && $word == -?* ]]; then
            flags=$word
            [[ $word == --* ]] || while (( $#flags > 2 && ! ${+takes[${flags[1,2]}]} )); do
                flags=-${flags[3,-1]}
            done
            pending=${takes[$flags]}
        elif (( ${cmds[(I)$word:*]} )); then
            where+=${where:+ }$word
            _handctl_node $where
        else
            (( count++ ))
        fi
    done
    if [[ -n $pending ]]; then
        _handctl_take $pending
    elif [[ -z $ends && $PREFIX == --*=* ]]; then
        pending=${takes[${PREFIX%%=*}]}
        [[ -n $pending ]] && compset -P '*=' && _handctl_take $pending
    elif [[ -z $ends && $PREFIX == -* ]]; then
        _describe -o -t options option opts
    elif (( $#cmds )); then
        _describe -t commands command cmds
    elif (( $#args )); then
        (( count < $#args )) || { count=$(( $#args - 1 )); [[ $args[-1] == *'*' ]] || return 1 }
        _handctl_take ${args[count + 1]%'*'}
    fi
}

if [[ $funcstack[1] == _handctl ]]; then
    _handctl "$@"
else
    compdef _handctl handctl handctl.pyz
fi
