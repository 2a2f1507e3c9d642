# PowerShell @MARK@: do not edit

function __handctl_split([string]$text) { # words of a table
    ,@($text.Split([char[]]' ', [StringSplitOptions]::RemoveEmptyEntries))
}

function __handctl_lookup([string]$word, $table) { # the content of WORD=CONTENT in a table; $null without
    foreach ($entry in $table) {
        if ($entry.StartsWith("$word=", [StringComparison]::Ordinal)) { return $entry.Substring($word.Length + 1) }
    }
    return $null
}

function __handctl_node([string]$path) { # what stands below PATH
    $found = @{ cmds = ''; opts = ''; takes = ''; args = ''; lacks = '' }
    switch -CaseSensitive -Exact ($path) {
@NODES@
    }
    $lacks = __handctl_split $found.lacks
    $shared = @((__handctl_split @SHARED@) | Where-Object { $lacks -cnotcontains $_ })
    return @{
        cmds = __handctl_split $found.cmds
        opts = @(__handctl_split $found.opts) + $shared
        takes = @(__handctl_split $found.takes) + @(__handctl_split @SHARED_TAKES@)
        args = __handctl_split $found.args
    }
}

function __handctl_map([string]$family) { # names of its quantities
    $found = @{ read = ''; set = ''; name = ''; elements = ''; values = '' }
    switch -CaseSensitive -Exact ($family) {
@MAPS@
    }
    return $found
}

function __handctl_devices { # the tables [devices.NAME] of the configuration file
    $base = $env:XDG_CONFIG_HOME
    if (-not $base) { $base = $env:APPDATA }
    if (-not $base) { $base = Join-Path $HOME '.config' }
    $file = Join-Path (Join-Path $base 'handctl') 'config.toml'
    if (Test-Path -LiteralPath $file -PathType Leaf) {
        foreach ($line in [IO.File]::ReadAllLines($file)) {
            if ($line -match '^\s*\[devices\."?([A-Za-z0-9_-]+)"?[\].]') { $Matches[1] }
        }
    }
}

function __handctl_names([string]$kind, [string]$family, [string]$value) { # quantities, their elements, their values
    $map = __handctl_map $family
    $sign = ''
    if ($kind -ceq 'set') { $sign = '=' }
    $base = ($value -split '[.=]', 2)[0]
    if ($sign -and $value.Contains('=')) {
        $listed = __handctl_lookup $base (__handctl_split $map.values)
        if ($listed) {
            $head = $value.Substring(0, $value.IndexOf('=') + 1)
            foreach ($word in $listed.Split(',')) { "$head$word" }
        }
        return
    }
    foreach ($word in (__handctl_split $map[$kind])) {
        "$word$sign"
        if ($word -ceq $base -or $word.StartsWith($value, [StringComparison]::Ordinal)) {
            $listed = __handctl_lookup $word (__handctl_split $map.elements)
            if ($listed -and ($value -ceq $word -or $value.Contains('.'))) {
                foreach ($element in $listed.Split(',')) { "$word.$element$sign" }
            }
        }
    }
}

function __handctl_take([string]$token, [string]$value) { # what may stand in this place
    $kind, $detail = $token -split ':', 2
    switch -CaseSensitive -Exact ($kind) {
        'choice' { $detail.Split(',') }
        'read' { __handctl_names $kind $detail $value }
        'set' { __handctl_names $kind $detail $value }
        'name' { __handctl_names $kind $detail $value }
        'device' { __handctl_devices }
        'link' {
            __handctl_split '@PREFIXES@ @FAKES@'
            try { [IO.Ports.SerialPort]::GetPortNames() } catch { }
        }
    }
}

function __handctl_words([string[]]$words, [string]$current) { # what may follow WORDS, each word whole
    $node = __handctl_node ''
    $path = ''
    $pending = ''
    $ends = $false
    $count = 0
    foreach ($word in @($words | Select-Object -Skip 1)) {
        if ($pending) {
            $pending = ''
        }
        elseif (-not $ends -and $word -ceq '--') {
            $ends = $true
        }
        elseif (-not $ends -and $word.StartsWith('--') -and $word.Contains('=')) {
            continue
        }
        elseif (-not $ends -and $word.StartsWith('-') -and $word.Length -gt 1) {
            $flags = $word
            while (-not $flags.StartsWith('--') -and $flags.Length -gt 2 -and
                $null -eq (__handctl_lookup $flags.Substring(0, 2) $node.takes)) {
                $flags = '-' + $flags.Substring(2)
            }
            $pending = __handctl_lookup $flags $node.takes
        }
        elseif ($node.cmds -ccontains $word) {
            $path = "$path $word".Trim()
            $node = __handctl_node $path
        }
        else {
            $count++
        }
    }
    if ($pending) {
        __handctl_take $pending $current
    }
    elseif (-not $ends -and $current.StartsWith('--') -and $current.Contains('=')) {
        $option, $value = $current -split '=', 2
        $pending = __handctl_lookup $option $node.takes
        if ($pending) {
            foreach ($word in @(__handctl_take $pending $value)) { "$option=$word" }
        }
    }
    elseif (-not $ends -and $current.StartsWith('-')) {
        $node.opts
    }
    elseif ($node.cmds.Count) {
        $node.cmds
    }
    elseif ($node.args.Count) {
        if ($count -ge $node.args.Count) {
            if (-not $node.args[-1].EndsWith('*')) { return }
            $count = $node.args.Count - 1
        }
        __handctl_take $node.args[$count].TrimEnd('*') $current
    }
}

Register-ArgumentCompleter -Native -CommandName handctl, handctl.exe, handctl.pyz -ScriptBlock {
    param($wordToComplete, $commandAst, $cursorPosition)
    $current = [string]$wordToComplete
    $words = @($commandAst.CommandElements |
        Where-Object { $_.Extent.EndOffset -lt $cursorPosition } |
        ForEach-Object { $_.Extent.Text })
    foreach ($word in @(__handctl_words $words $current)) {
        if ($word -and $word.StartsWith($current, [StringComparison]::Ordinal)) {
            [Management.Automation.CompletionResult]::new($word, $word, 'ParameterValue', $word)
        }
    }
}
