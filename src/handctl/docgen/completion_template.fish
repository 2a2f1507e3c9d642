# fish @MARK@: do not edit

function __handctl_node --no-scope-shadowing # PATH: what stands below it; sets cmds opts takes args
    set shared @SHARED@
    set lacks
    set cmds
    set opts
    set takes
    set args
    switch "$argv[1]"
@NODES@
    end
    for option in $lacks
        set shared (string match -v -- $option\t'*' $shared)
    end
    set -a opts $shared
    set -a takes @SHARED_TAKES@
end

function __handctl_map --no-scope-shadowing # FAMILY: names of its quantities; sets readable settable known elements values
    switch "$argv[1]"
@MAPS@
    end
end

function __handctl_lookup # WORD WORD=CONTENT...: the content of that word
    for entry in $argv[2..-1]
        if string match -q -- "$argv[1]=*" $entry
            string replace -- "$argv[1]=" '' $entry
            return
        end
    end
    return 1
end

function __handctl_link # VALUE: what a LINK may be
    if string match -q 'replay:*' -- $argv[1]
        string replace -r -- '^' replay: (__fish_complete_path (string replace 'replay:' '' -- $argv[1]))
        return
    end
    printf '%s\n' @PREFIXES@ @FAKES@
    set -l ports @PORTS@
    set -l interfaces @INTERFACES@
    set -l slcan @SLCAN@
    string join \n -- $ports can:socketcan:(string replace -r '.*/' '' -- $interfaces) can:slcan:$slcan
    if string match -qr '^[./~]' -- $argv[1]
        __fish_complete_path $argv[1]
    end
end

function __handctl_devices # the tables [devices.NAME] of the configuration file
    set -l base $HOME/.config
    set -q XDG_CONFIG_HOME; and set base $XDG_CONFIG_HOME
    set -l file $base/handctl/config.toml
    if test -r $file
        string replace -rf '^\s*\[devices\."?([A-Za-z0-9_-]+)"?[\].].*' '$1' <$file
    end
end

function __handctl_names # read|set|name FAMILY VALUE: quantities, then their elements, then their values
    set -l readable
    set -l settable
    set -l known
    set -l elements
    set -l values
    set -l sign ''
    __handctl_map $argv[2]
    set -l words $readable
    switch $argv[1]
        case set
            set words $settable
            set sign =
        case name
            set words $known
    end
    set -l base (string replace -r '[.=].*' '' -- $argv[3])
    if test -n "$sign"; and string match -q '*=*' -- $argv[3]
        set -l found (__handctl_lookup $base $values)
        and string replace -r -- '^' (string replace -r '=.*' '=' -- $argv[3]) (string split , -- $found)
        return
    end
    for word in $words
        set -l parts (string split -m 1 \t -- $word)
        if string match -q -- "$argv[3]*" $parts[1]; or test "$base" = "$parts[1]"
            string join \t -- $parts[1]$sign $parts[2..-1]
            set -l found (__handctl_lookup $parts[1] $elements)
            and printf '%s\n' $parts[1].(string split , -- $found)$sign
        end
    end
end

function __handctl_take # TOKEN VALUE: what may stand in this place
    set -l parts (string split -m 1 : -- $argv[1])
    switch $parts[1]
        case choice
            string split , -- $parts[2]
        case read set name
            __handctl_names $parts[1] $parts[2] "$argv[2]"
        case link
            __handctl_link "$argv[2]"
        case device
            __handctl_devices
        case file
            __fish_complete_path "$argv[2]"
        case dir
            __fish_complete_directories "$argv[2]"
    end
end

function __handctl
    set -l shared
    set -l lacks
    set -l cmds
    set -l opts
    set -l takes
    set -l args
    set -l where
    set -l pending
    set -l ends
    set -l count 0
    set -l tokens (commandline -opc)
    set -l current (commandline -ct)
    __handctl_node ''
    for word in $tokens[2..-1]
        if test -n "$pending"
            set pending
        else if test -z "$ends" -a "x$word" = x--
            set ends yes
        else if test -z "$ends"; and string match -q -- '--*=*' $word
            continue
        else if test -z "$ends"; and string match -q -- '-?*' $word
            set -l flags $word
            if not string match -q -- '--*' $word
                while test (string length -- $flags) -gt 2; and not __handctl_lookup (string sub -l 2 -- $flags) $takes >/dev/null
                    set flags -(string sub -s 3 -- $flags)
                end
            end
            set pending (__handctl_lookup $flags $takes)
        else if string match -q -- $word\t'*' $cmds
            set where (string trim -- "$where $word")
            __handctl_node $where
        else
            set count (math $count + 1)
        end
    end
    if test -n "$pending"
        __handctl_take $pending "$current"
    else if test -z "$ends"; and string match -q -- '--*=*' $current
        set -l parts (string split -m 1 = -- $current)
        set pending (__handctl_lookup $parts[1] $takes)
        and string replace -r -- '^' "$parts[1]=" (__handctl_take $pending "$parts[2]")
    else if test -z "$ends"; and string match -q -- '-*' $current
        printf '%s\n' $opts
    else if test (builtin count $cmds) -gt 0
        printf '%s\n' $cmds
    else if test (builtin count $args) -gt 0
        if test $count -ge (builtin count $args)
            string match -q '*\*' -- $args[-1]; or return
            set count (math (builtin count $args) - 1)
        end
        __handctl_take (string replace -r '\*$' '' -- $args[(math $count + 1)]) "$current"
    end
end

complete -c handctl -f -a '(__handctl)'
complete -c handctl.pyz -f -a '(__handctl)'
