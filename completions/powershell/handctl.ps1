# PowerShell completion of handctl, generated from its command tree: do not edit

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
        '' { $found.cmds = 'exo wrist barrett ekso aidin hand ports scan top history prove doctor service stop shell batch devices completion sim plot trace twin help'; $found.opts = '-V --version -h --help' }
        'exo' { $found.cmds = 'status dump get watch describe stop position force set id baud save factory-reset report doctor clear-errors calibrate scan listen terminal read write raw snapshot diff restore log export'; $found.opts = '-h --help' }
        'exo status' { $found.opts = '--check --picture --limit -h --help'; $found.takes = '--picture=none --limit=none'; $found.lacks = '-n --dry-run -y --yes --history' }
        'exo dump' { $found.opts = '--limit -h --help'; $found.takes = '--limit=none'; $found.lacks = '-n --dry-run -y --yes --history' }
        'exo get' { $found.opts = '--limit -h --help'; $found.takes = '--limit=none'; $found.args = 'read:exo*'; $found.lacks = '-n --dry-run -y --yes --history' }
        'exo watch' { $found.opts = '--rate --count --duration --limit --until -h --help'; $found.takes = '--rate=none --count=none --duration=none --limit=none --until=none'; $found.args = 'read:exo*'; $found.lacks = '-n --dry-run -y --yes --history' }
        'exo describe' { $found.opts = '-h --help'; $found.args = 'name:exo*'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'exo stop' { $found.opts = '-h --help' }
        'exo position' { $found.opts = '--wait --expect -h --help'; $found.takes = '--wait=none --expect=choice:reached,contact,any'; $found.args = 'none*' }
        'exo force' { $found.opts = '-h --help'; $found.args = 'none*' }
        'exo set' { $found.opts = '--always -h --help'; $found.args = 'set:exo*' }
        'exo id' { $found.opts = '-h --help'; $found.args = 'none' }
        'exo baud' { $found.opts = '--save --verify -h --help'; $found.args = 'none' }
        'exo save' { $found.opts = '--skip-identity-check -h --help' }
        'exo factory-reset' { $found.opts = '--undocumented-address --backup --skip-identity-check -h --help'; $found.takes = '--backup=file' }
        'exo report' { $found.opts = '--watch --include-ids --force -h --help'; $found.takes = '--watch=none'; $found.args = 'file'; $found.lacks = '-n --dry-run -y --yes --history' }
        'exo doctor' { $found.opts = '--count -h --help'; $found.takes = '--count=none'; $found.lacks = '-n --dry-run -y --yes --history' }
        'exo clear-errors' { $found.opts = '-h --help' }
        'exo calibrate' { $found.opts = '-h --help' }
        'exo scan' { $found.opts = '--ids --all -h --help'; $found.takes = '--ids=none'; $found.lacks = '-n --dry-run -y --yes --history' }
        'exo listen' { $found.opts = '--count --duration --find-baud -h --help'; $found.takes = '--count=none --duration=none'; $found.lacks = '-n --dry-run -y --yes --history' }
        'exo terminal' { $found.opts = '--hex --wait -h --help'; $found.takes = '--wait=none'; $found.args = 'none*' }
        'exo read' { $found.opts = '-h --help'; $found.args = 'none none'; $found.lacks = '-n --dry-run -y --yes --history' }
        'exo write' { $found.opts = '--undocumented -h --help'; $found.args = 'none none' }
        'exo raw' { $found.opts = '--wait --force-ambiguous -h --help'; $found.takes = '--wait=none'; $found.args = 'none*' }
        'exo snapshot' { $found.opts = '-h --help'; $found.args = 'file'; $found.lacks = '-n --dry-run -y --yes --history' }
        'exo diff' { $found.opts = '--setpoints -h --help'; $found.args = 'file file'; $found.lacks = '-n --dry-run -y --yes --history' }
        'exo restore' { $found.opts = '--setpoints --skip -h --help'; $found.takes = '--skip=none'; $found.args = 'file' }
        'exo log' { $found.opts = '--rate --count --duration --mark --mark-udp --lsl --mark-stdin --silence --force --check --limit --until -h --help'; $found.takes = '--rate=none --count=none --duration=none --mark=none --mark-udp=link --silence=none --limit=none --until=none'; $found.args = 'file read:exo*'; $found.lacks = '-n --dry-run -y --yes --history' }
        'exo export' { $found.opts = '--to --segment --rate -h --help'; $found.takes = '--to=choice:parquet,bids,c3d,mcap,xdf --segment=none --rate=none'; $found.args = 'file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'wrist' { $found.cmds = 'status dump get watch describe stop move center set report doctor scan read listen terminal hand-read write hand-write raw snapshot diff restore log export'; $found.opts = '-h --help --serial --can' }
        'wrist status' { $found.opts = '--check --picture --limit -h --help --serial --can'; $found.takes = '--picture=none --limit=none'; $found.lacks = '-n --dry-run -y --yes --history' }
        'wrist dump' { $found.opts = '--limit -h --help --serial --can'; $found.takes = '--limit=none'; $found.lacks = '-n --dry-run -y --yes --history' }
        'wrist get' { $found.opts = '--limit -h --help --serial --can'; $found.takes = '--limit=none'; $found.args = 'read:wrist*'; $found.lacks = '-n --dry-run -y --yes --history' }
        'wrist watch' { $found.opts = '--rate --count --duration --limit --until -h --help --serial --can'; $found.takes = '--rate=none --count=none --duration=none --limit=none --until=none'; $found.args = 'read:wrist*'; $found.lacks = '-n --dry-run -y --yes --history' }
        'wrist describe' { $found.opts = '-h --help'; $found.args = 'name:wrist*'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'wrist stop' { $found.opts = '-h --help --serial --can' }
        'wrist move' { $found.opts = '--pitch --yaw --time --wait --expect -h --help --serial --can'; $found.takes = '--pitch=none --yaw=none --time=none --wait=none --expect=choice:reached,contact,any'; $found.lacks = '--time' }
        'wrist center' { $found.opts = '--time --expect -h --help --serial --can'; $found.takes = '--time=none --expect=choice:reached,contact,any'; $found.lacks = '--time' }
        'wrist set' { $found.opts = '--always -h --help --serial --can'; $found.args = 'set:wrist*' }
        'wrist report' { $found.opts = '--watch --include-ids --force -h --help --serial --can'; $found.takes = '--watch=none'; $found.args = 'file'; $found.lacks = '-n --dry-run -y --yes --history' }
        'wrist doctor' { $found.opts = '--count -h --help --serial --can'; $found.takes = '--count=none'; $found.lacks = '-n --dry-run -y --yes --history' }
        'wrist scan' { $found.opts = '--ids --all -h --help --serial --can'; $found.takes = '--ids=none'; $found.lacks = '-n --dry-run -y --yes --history' }
        'wrist read' { $found.opts = '-h --help --serial --can'; $found.args = 'none none'; $found.lacks = '-n --dry-run -y --yes --history' }
        'wrist listen' { $found.opts = '--count --duration --find-baud -h --help --serial --can'; $found.takes = '--count=none --duration=none'; $found.lacks = '-n --dry-run -y --yes --history' }
        'wrist terminal' { $found.opts = '--hex --wait -h --help --serial --can'; $found.takes = '--wait=none'; $found.args = 'none*' }
        'wrist hand-read' { $found.opts = '-h --help --serial --can'; $found.args = 'none none'; $found.lacks = '-n --dry-run -y --yes --history' }
        'wrist write' { $found.opts = '-h --help --serial --can'; $found.args = 'none none' }
        'wrist hand-write' { $found.opts = '--undocumented --force-ambiguous -h --help --serial --can'; $found.args = 'none none' }
        'wrist raw' { $found.opts = '--wait --force-ambiguous -h --help --serial --can'; $found.takes = '--wait=none'; $found.args = 'none*' }
        'wrist snapshot' { $found.opts = '-h --help --serial --can'; $found.args = 'file'; $found.lacks = '-n --dry-run -y --yes --history' }
        'wrist diff' { $found.opts = '--setpoints -h --help --serial --can'; $found.args = 'file file'; $found.lacks = '-n --dry-run -y --yes --history' }
        'wrist restore' { $found.opts = '--setpoints --skip -h --help --serial --can'; $found.takes = '--skip=none'; $found.args = 'file' }
        'wrist log' { $found.opts = '--rate --count --duration --mark --mark-udp --lsl --mark-stdin --silence --force --check --limit --until -h --help --serial --can'; $found.takes = '--rate=none --count=none --duration=none --mark=none --mark-udp=link --silence=none --limit=none --until=none'; $found.args = 'file read:wrist*'; $found.lacks = '-n --dry-run -y --yes --history' }
        'wrist export' { $found.opts = '--to --segment --rate -h --help'; $found.takes = '--to=choice:parquet,bids,c3d,mcap,xdf --segment=none --rate=none'; $found.args = 'file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'barrett' { $found.cmds = 'status dump get watch describe version errors help fingertips stop init open close move home step-open step-close torque-open torque-close realtime set save baud load defaults report doctor diagnose maintenance strain scan listen terminal reset gcl firmware first-light snapshot diff restore log export'; $found.opts = '-h --help --interrupt'; $found.lacks = '--id' }
        'barrett status' { $found.opts = '--check --picture --limit --include-ids -h --help --interrupt'; $found.takes = '--picture=none --limit=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett dump' { $found.opts = '--limit --include-ids -h --help --interrupt'; $found.takes = '--limit=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett get' { $found.opts = '--limit -h --help --interrupt'; $found.takes = '--limit=none'; $found.args = 'read:barrett*'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett watch' { $found.opts = '--rate --count --duration --limit --until -h --help --interrupt'; $found.takes = '--rate=none --count=none --duration=none --limit=none --until=none'; $found.args = 'read:barrett*'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett describe' { $found.opts = '-h --help'; $found.args = 'name:barrett*'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'barrett version' { $found.opts = '-h --help --interrupt'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett errors' { $found.opts = '-h --help'; $found.args = 'none'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'barrett help' { $found.opts = '-h --help --interrupt'; $found.args = 'none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett fingertips' { $found.opts = '--positions --breakaway --live --rate --count --duration --limit --until -h --help --interrupt'; $found.takes = '--positions=none --breakaway=none --rate=none --count=none --duration=none --limit=none --until=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett stop' { $found.opts = '--motors -h --help --interrupt'; $found.takes = '--motors=none'; $found.lacks = '--id' }
        'barrett init' { $found.opts = '--force --motors --expect -h --help --interrupt'; $found.takes = '--motors=none --expect=choice:reached,contact,any'; $found.lacks = '--id' }
        'barrett open' { $found.opts = '--force --motors --expect -h --help --interrupt'; $found.takes = '--motors=none --expect=choice:reached,contact,any'; $found.lacks = '--id' }
        'barrett close' { $found.opts = '--force --motors --expect -h --help --interrupt'; $found.takes = '--motors=none --expect=choice:reached,contact,any'; $found.lacks = '--id' }
        'barrett move' { $found.opts = '--force --motors --expect -h --help --interrupt'; $found.takes = '--motors=none --expect=choice:reached,contact,any'; $found.args = 'none*'; $found.lacks = '--id' }
        'barrett home' { $found.opts = '--force --motors --expect -h --help --interrupt'; $found.takes = '--motors=none --expect=choice:reached,contact,any'; $found.lacks = '--id' }
        'barrett step-open' { $found.opts = '--force --motors --expect -h --help --interrupt'; $found.takes = '--motors=none --expect=choice:reached,contact,any'; $found.args = 'none*'; $found.lacks = '--id' }
        'barrett step-close' { $found.opts = '--force --motors --expect -h --help --interrupt'; $found.takes = '--motors=none --expect=choice:reached,contact,any'; $found.args = 'none*'; $found.lacks = '--id' }
        'barrett torque-open' { $found.opts = '--force --motors --expect -h --help --interrupt'; $found.takes = '--motors=none --expect=choice:reached,contact,any'; $found.lacks = '--id' }
        'barrett torque-close' { $found.opts = '--motors --expect -h --help --interrupt'; $found.takes = '--motors=none --expect=choice:reached,contact,any'; $found.lacks = '--id' }
        'barrett realtime' { $found.opts = '--motors --send --receive --angles --velocity --gain --control --law --until --log --mark --mark-udp --lsl --mark-stdin --measure --sequential --overlapped --no-guard --force --delta-unit --init --hold --may-suspend --rate --count --duration -h --help --interrupt'; $found.takes = '--motors=none --send=none --receive=none --velocity=none --gain=none --control=file --law=none --until=none --log=file --mark=none --mark-udp=link --measure=none --no-guard=choice:stall,window,strain,opening,heat,all --delta-unit=none --rate=none --count=none --duration=none'; $found.lacks = '--id' }
        'barrett set' { $found.opts = '--motors --force --always -h --help --interrupt'; $found.takes = '--motors=none'; $found.args = 'set:barrett*'; $found.lacks = '--id' }
        'barrett save' { $found.opts = '--motors --force -h --help --interrupt'; $found.takes = '--motors=none'; $found.lacks = '--id' }
        'barrett baud' { $found.opts = '--save -h --help --interrupt'; $found.args = 'none'; $found.lacks = '--id' }
        'barrett load' { $found.opts = '--motors -h --help --interrupt'; $found.takes = '--motors=none'; $found.lacks = '--id' }
        'barrett defaults' { $found.opts = '--motors -h --help --interrupt'; $found.takes = '--motors=none'; $found.lacks = '--id' }
        'barrett report' { $found.opts = '--watch --include-ids --force -h --help --interrupt'; $found.takes = '--watch=none'; $found.args = 'file'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett doctor' { $found.opts = '--count -h --help --interrupt'; $found.takes = '--count=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett diagnose' { $found.opts = '--list --move --motors --hand -h --help --interrupt'; $found.takes = '--motors=none --hand=none'; $found.args = 'none'; $found.lacks = '--id' }
        'barrett maintenance' { $found.opts = '--greased --steps --check --hand -h --help --interrupt'; $found.takes = '--greased=none --steps=choice:lubrication,fasteners,pretension,strain,firmware --hand=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett strain' { $found.opts = '--open --live --check --rate --count --duration --limit --until -h --help --interrupt'; $found.takes = '--rate=none --count=none --duration=none --limit=none --until=none'; $found.lacks = '--id' }
        'barrett scan' { $found.opts = '--ids --all -h --help --interrupt'; $found.takes = '--ids=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett listen' { $found.opts = '--count --duration --find-baud -h --help --interrupt'; $found.takes = '--count=none --duration=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett terminal' { $found.opts = '--hex --wait -h --help --interrupt'; $found.takes = '--wait=none'; $found.args = 'none*'; $found.lacks = '--id' }
        'barrett reset' { $found.opts = '-h --help --interrupt'; $found.lacks = '--id' }
        'barrett gcl' { $found.opts = '--keep-going --file --force -h --help --interrupt'; $found.takes = '--file=file'; $found.args = 'none*'; $found.lacks = '--id' }
        'barrett firmware' { $found.cmds = 'check download'; $found.opts = '-h --help --interrupt'; $found.lacks = '--id' }
        'barrett firmware check' { $found.opts = '--force -h --help'; $found.args = 'file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'barrett firmware download' { $found.opts = '--force --expect --window -h --help --interrupt'; $found.takes = '--expect=none --window=none'; $found.args = 'file'; $found.lacks = '--id' }
        'barrett first-light' { $found.opts = '--skip --repeat --identify --keep --hand -h --help --interrupt'; $found.takes = '--skip=choice:power-on,firmware,settings,temperature,init,strain,origin,position-at-stop,finger-speed,spread-speed,highest-speed,early-breakaway,breakaway,grease --repeat=none --keep=file --hand=none'; $found.args = 'link'; $found.lacks = '--id' }
        'barrett snapshot' { $found.opts = '-h --help --interrupt'; $found.args = 'file'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett diff' { $found.opts = '-h --help --interrupt'; $found.args = 'file file'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett restore' { $found.opts = '--save --force --skip -h --help --interrupt'; $found.takes = '--skip=none'; $found.args = 'file'; $found.lacks = '--id' }
        'barrett log' { $found.opts = '--rate --count --duration --mark --mark-udp --lsl --mark-stdin --silence --force --check --limit --until -h --help --interrupt'; $found.takes = '--rate=none --count=none --duration=none --mark=none --mark-udp=link --silence=none --limit=none --until=none'; $found.args = 'file read:barrett*'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'barrett export' { $found.opts = '--to --segment --rate -h --help'; $found.takes = '--to=choice:parquet,bids,c3d,mcap,xdf --segment=none --rate=none'; $found.args = 'file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'ekso' { $found.cmds = 'status dump get watch describe time date settings data feedback policy stop set cancel report doctor scan listen terminal snapshot diff restore log export gait'; $found.opts = '-h --help'; $found.lacks = '--id' }
        'ekso status' { $found.opts = '--check --picture --limit --length-mode -h --help'; $found.takes = '--picture=none --limit=none --length-mode=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso dump' { $found.opts = '--limit --length-mode -h --help'; $found.takes = '--limit=none --length-mode=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso get' { $found.opts = '--limit --length-mode -h --help'; $found.takes = '--limit=none --length-mode=none'; $found.args = 'read:ekso*'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso watch' { $found.opts = '--rate --count --duration --limit --until --length-mode -h --help'; $found.takes = '--rate=none --count=none --duration=none --limit=none --until=none --length-mode=none'; $found.args = 'read:ekso*'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso describe' { $found.opts = '-h --help'; $found.args = 'name:ekso*'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'ekso time' { $found.opts = '--length-mode -h --help'; $found.takes = '--length-mode=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso date' { $found.opts = '--length-mode -h --help'; $found.takes = '--length-mode=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso settings' { $found.opts = '--length-mode -h --help'; $found.takes = '--length-mode=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso data' { $found.opts = '--length-mode -h --help'; $found.takes = '--length-mode=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso feedback' { $found.opts = '--length-mode -h --help'; $found.takes = '--length-mode=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso policy' { $found.opts = '--audit -h --help'; $found.takes = '--audit=file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'ekso stop' { $found.opts = '--length-mode -h --help'; $found.takes = '--length-mode=none'; $found.lacks = '--id' }
        'ekso set' { $found.opts = '--operator --audit --override-step-limit --length-mode -h --help'; $found.takes = '--operator=none --audit=file --length-mode=none'; $found.args = 'set:ekso*'; $found.lacks = '--id' }
        'ekso cancel' { $found.opts = '--word --operator --audit --length-mode -h --help'; $found.takes = '--word=none --operator=none --audit=file --length-mode=none'; $found.lacks = '--id' }
        'ekso report' { $found.opts = '--watch --include-ids --force --length-mode -h --help'; $found.takes = '--watch=none --length-mode=none'; $found.args = 'file'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso doctor' { $found.opts = '--count --length-mode -h --help'; $found.takes = '--count=none --length-mode=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso scan' { $found.opts = '--ids --all --length-mode -h --help'; $found.takes = '--ids=none --length-mode=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso listen' { $found.opts = '--count --duration --find-baud --length-mode -h --help'; $found.takes = '--count=none --duration=none --length-mode=none'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso terminal' { $found.opts = '--hex --wait --length-mode -h --help'; $found.takes = '--wait=none --length-mode=none'; $found.args = 'none*'; $found.lacks = '--id' }
        'ekso snapshot' { $found.opts = '--length-mode -h --help'; $found.takes = '--length-mode=none'; $found.args = 'file'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso diff' { $found.opts = '--length-mode -h --help'; $found.takes = '--length-mode=none'; $found.args = 'file file'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso restore' { $found.opts = '--operator --audit --override-step-limit --skip --length-mode -h --help'; $found.takes = '--operator=none --audit=file --skip=none --length-mode=none'; $found.args = 'file'; $found.lacks = '--id' }
        'ekso log' { $found.opts = '--rate --count --duration --mark --mark-udp --lsl --mark-stdin --silence --force --check --limit --until --raw --include-pilot-id --length-mode -h --help'; $found.takes = '--rate=none --count=none --duration=none --mark=none --mark-udp=link --silence=none --limit=none --until=none --length-mode=none'; $found.args = 'file'; $found.lacks = '--id -n --dry-run -y --yes --history' }
        'ekso export' { $found.opts = '--to --format --si --segment --knee-sign --rate -h --help'; $found.takes = '--to=choice:mot,csv,parquet,bids,c3d,mcap,xdf --format=choice:mot,csv,parquet,bids,c3d,mcap,xdf --segment=none --knee-sign=choice:1,-1 --rate=none'; $found.args = 'file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format -n --dry-run -y --yes --history --assume-identity' }
        'ekso gait' { $found.opts = '--steps --page -h --help'; $found.takes = '--steps=file --page=file'; $found.args = 'file file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'aidin' { $found.cmds = 'status dump get watch describe stop home initial encoders joints fingertips currents bias max-torque report doctor scan listen terminal check log export'; $found.opts = '-h --help --exchange --poll-json --tx-terminator'; $found.takes = '--exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.lacks = '--id --baud' }
        'aidin status' { $found.opts = '--check --picture --limit -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--picture=none --limit=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.lacks = '--id --baud -n --dry-run -y --yes --history' }
        'aidin dump' { $found.opts = '--limit -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--limit=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.lacks = '--id --baud -n --dry-run -y --yes --history' }
        'aidin get' { $found.opts = '--limit -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--limit=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.args = 'read:aidin*'; $found.lacks = '--id --baud -n --dry-run -y --yes --history' }
        'aidin watch' { $found.opts = '--rate --count --duration --limit --until -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--rate=none --count=none --duration=none --limit=none --until=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.args = 'read:aidin*'; $found.lacks = '--id --baud -n --dry-run -y --yes --history' }
        'aidin describe' { $found.opts = '-h --help'; $found.args = 'name:aidin*'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'aidin stop' { $found.opts = '-h --help --exchange --poll-json --tx-terminator'; $found.takes = '--exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.lacks = '--id --baud' }
        'aidin home' { $found.opts = '-h --help --exchange --poll-json --tx-terminator'; $found.takes = '--exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.lacks = '--id --baud' }
        'aidin initial' { $found.opts = '--assume-homed -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.lacks = '--id --baud' }
        'aidin encoders' { $found.opts = '--assume-homed --expect -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--expect=choice:reached,contact,any --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.args = 'none*'; $found.lacks = '--id --baud' }
        'aidin joints' { $found.opts = '--rad --assume-homed --expect -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--expect=choice:reached,contact,any --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.args = 'none*'; $found.lacks = '--id --baud' }
        'aidin fingertips' { $found.opts = '--assume-homed --expect -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--expect=choice:reached,contact,any --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.args = 'none*'; $found.lacks = '--id --baud' }
        'aidin currents' { $found.opts = '--cap --duration --ramp-down --may-suspend -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--cap=none --duration=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.args = 'none*'; $found.lacks = '--id --baud' }
        'aidin bias' { $found.opts = '-h --help --exchange --poll-json --tx-terminator'; $found.takes = '--exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.lacks = '--id --baud' }
        'aidin max-torque' { $found.opts = '-h --help --exchange --poll-json --tx-terminator'; $found.takes = '--exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.args = 'none'; $found.lacks = '--id --baud' }
        'aidin report' { $found.opts = '--watch --include-ids --force -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--watch=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.args = 'file'; $found.lacks = '--id --baud -n --dry-run -y --yes --history' }
        'aidin doctor' { $found.opts = '--count -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--count=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.lacks = '--id --baud -n --dry-run -y --yes --history' }
        'aidin scan' { $found.opts = '--ids --all -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--ids=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.lacks = '--id --baud -n --dry-run -y --yes --history' }
        'aidin listen' { $found.opts = '--count --duration --find-baud -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--count=none --duration=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.lacks = '--id --baud -n --dry-run -y --yes --history' }
        'aidin terminal' { $found.opts = '--hex --wait -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--wait=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.args = 'none*'; $found.lacks = '--id --baud' }
        'aidin check' { $found.opts = '-h --help --exchange --poll-json --tx-terminator'; $found.takes = '--exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.lacks = '--id --baud' }
        'aidin log' { $found.opts = '--rate --count --duration --mark --mark-udp --lsl --mark-stdin --silence --force --check --limit --until -h --help --exchange --poll-json --tx-terminator'; $found.takes = '--rate=none --count=none --duration=none --mark=none --mark-udp=link --silence=none --limit=none --until=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf'; $found.args = 'file read:aidin*'; $found.lacks = '--id --baud -n --dry-run -y --yes --history' }
        'aidin export' { $found.opts = '--to --segment --rate -h --help'; $found.takes = '--to=choice:parquet,bids,c3d,mcap,xdf --segment=none --rate=none'; $found.args = 'file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'hand' { $found.cmds = 'status dump get watch describe tactile stop angle position speed force set id baud save factory-reset network pair report doctor clear-errors calibrate scan listen terminal read write raw snapshot diff restore log export'; $found.opts = '-h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus' }
        'hand status' { $found.opts = '--check --picture --limit -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--picture=none --limit=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.lacks = '-n --dry-run -y --yes --history' }
        'hand dump' { $found.opts = '--limit -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--limit=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.lacks = '-n --dry-run -y --yes --history' }
        'hand get' { $found.opts = '--limit -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--limit=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'read:hand*'; $found.lacks = '-n --dry-run -y --yes --history' }
        'hand watch' { $found.opts = '--rate --count --duration --limit --until -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--rate=none --count=none --duration=none --limit=none --until=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'read:hand*'; $found.lacks = '-n --dry-run -y --yes --history' }
        'hand describe' { $found.opts = '-h --help'; $found.args = 'name:hand*'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'hand tactile' { $found.opts = '--watch --rate --count --duration --limit --until -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--rate=none --count=none --duration=none --limit=none --until=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'none*'; $found.lacks = '-n --dry-run -y --yes --history' }
        'hand stop' { $found.opts = '-h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus' }
        'hand angle' { $found.opts = '--wait --expect -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--wait=none --expect=choice:reached,contact,any --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'none*' }
        'hand position' { $found.opts = '--wait --expect -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--wait=none --expect=choice:reached,contact,any --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'none*' }
        'hand speed' { $found.opts = '-h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'none*' }
        'hand force' { $found.opts = '-h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'none*' }
        'hand set' { $found.opts = '--always -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'set:hand*' }
        'hand id' { $found.opts = '-h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'none' }
        'hand baud' { $found.opts = '--save --verify -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'none' }
        'hand save' { $found.opts = '-h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus' }
        'hand factory-reset' { $found.opts = '--backup -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--backup=file --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus' }
        'hand network' { $found.opts = '-h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'none' }
        'hand pair' { $found.opts = '--first --address --left --right --force -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--first=choice:left,right --address=none --left=none --right=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'link*' }
        'hand report' { $found.opts = '--watch --include-ids --force -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--watch=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'file'; $found.lacks = '-n --dry-run -y --yes --history' }
        'hand doctor' { $found.opts = '--count -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--count=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.lacks = '-n --dry-run -y --yes --history' }
        'hand clear-errors' { $found.opts = '-h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus' }
        'hand calibrate' { $found.opts = '-h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus' }
        'hand scan' { $found.opts = '--ids --all -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--ids=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.lacks = '-n --dry-run -y --yes --history' }
        'hand listen' { $found.opts = '--count --duration --find-baud -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--count=none --duration=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.lacks = '-n --dry-run -y --yes --history' }
        'hand terminal' { $found.opts = '--hex --wait -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--wait=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'none*' }
        'hand read' { $found.opts = '-h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'none none'; $found.lacks = '-n --dry-run -y --yes --history' }
        'hand write' { $found.opts = '--undocumented -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'none none' }
        'hand raw' { $found.opts = '--wait --force-ambiguous -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--wait=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'none*' }
        'hand snapshot' { $found.opts = '-h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'file'; $found.lacks = '-n --dry-run -y --yes --history' }
        'hand diff' { $found.opts = '-h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'file file'; $found.lacks = '-n --dry-run -y --yes --history' }
        'hand restore' { $found.opts = '--skip -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--skip=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'file' }
        'hand log' { $found.opts = '--rate --count --duration --mark --mark-udp --lsl --mark-stdin --silence --force --check --limit --until -h --help --serial --can --modbus-tcp --model --side --protocol'; $found.takes = '--rate=none --count=none --duration=none --mark=none --mark-udp=link --silence=none --limit=none --until=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus'; $found.args = 'file read:hand*'; $found.lacks = '-n --dry-run -y --yes --history' }
        'hand export' { $found.opts = '--to --segment --rate -h --help'; $found.takes = '--to=choice:parquet,bids,c3d,mcap,xdf --segment=none --rate=none'; $found.args = 'file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'ports' { $found.opts = '-h --help'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'scan' { $found.opts = '-p --port --family --ids --all -h --help'; $found.takes = '-p=link --port=link --family=choice:exo,wrist,barrett,ekso,aidin,hand --ids=none'; $found.lacks = '-p --port -n --dry-run -y --yes --history --assume-identity' }
        'top' { $found.opts = '--rate --count --duration --limit -h --help'; $found.takes = '--rate=none --count=none --duration=none --limit=none'; $found.args = 'none*'; $found.lacks = '-n --dry-run -y --yes --history --assume-identity' }
        'history' { $found.opts = '--since --last -h --help'; $found.takes = '--since=none --last=none'; $found.args = 'none'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'prove' { $found.opts = '--list --level --only --repeat --meter --length-mode --operator --identify -h --help'; $found.takes = '--level=choice:read,write-back,move,permanent --only=none --repeat=none --meter=none --length-mode=none --operator=none'; $found.args = 'choice:exo,wrist,barrett,ekso,aidin,hand,diff file*' }
        'doctor' { $found.opts = '--family --count -h --help'; $found.takes = '--family=choice:exo,wrist,barrett,ekso,aidin,hand --count=none'; $found.lacks = '-n --dry-run -y --yes --history --assume-identity' }
        'service' { $found.opts = '--family --complaint --ticket --report --skip --resume --against --watch --count --follow --include-ids --force --demo --finding --seed -h --help'; $found.takes = '--family=choice:exo,wrist,barrett,ekso,aidin,hand --complaint=none --ticket=none --report=file --skip=choice:doctor,status,diagnose,watch,dump --resume=file --against=file --watch=none --count=none --demo=choice:any,exo,wrist,barrett,ekso,aidin,hand --finding=none --seed=none'; $found.args = 'link'; $found.lacks = '-n --dry-run -y --yes --history --assume-identity' }
        'stop' { $found.opts = '-h --help' }
        'shell' { $found.opts = '-h --help'; $found.args = 'choice:exo,wrist,barrett,ekso,aidin,hand' }
        'batch' { $found.opts = '--keep-going -h --help'; $found.args = 'file' }
        'devices' { $found.cmds = 'list add remove show'; $found.opts = '-h --help' }
        'devices list' { $found.opts = '-h --help'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'devices add' { $found.opts = '--from-scan --force -h --help'; $found.takes = '--from-scan=file'; $found.args = 'none choice:exo,wrist,barrett,ekso,aidin,hand' }
        'devices remove' { $found.opts = '-h --help'; $found.args = 'device'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --assume-identity' }
        'devices show' { $found.opts = '-h --help'; $found.args = 'device'; $found.lacks = '-n --dry-run -y --yes --history --assume-identity' }
        'completion' { $found.opts = '--install -h --help'; $found.args = 'choice:bash,zsh,fish,powershell'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --assume-identity' }
        'sim' { $found.cmds = 'aidin barrett bus control ekso exo forget hand wrist'; $found.opts = '-h --help'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity' }
        'sim aidin' { $found.opts = '--tcp --seed --fault --after --every --wire --facts --state --duration --control --set --transcript -h --help'; $found.takes = '--tcp=none --seed=none --fault=choice:healthy,silent,deaf,noise,garble,truncate,dribble,split,bad-checksum,wrong-id,twin-id,echo,loopback,duplicate,stale,late,slow,disconnect,refuse,missing-key,extra-key,wrong-length,nan,wrong-type,not-json,braces,unclosed,degrees,swapped,stuck,frozen,blocked,dead-motor,no-homing,no-bias,weak,held,stall,creep,stiff,one-way,shaky-sensor,numb-sensor,touched --after=none --every=none --wire=none --facts=file --state=file --duration=none --control=file --set=none --transcript=file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity' }
        'sim barrett' { $found.opts = '--pty --by-id --tcp --seed --fault --after --every --wire --facts --state --duration --control --set --transcript -h --help'; $found.takes = '--by-id=file --tcp=none --seed=none --fault=choice:healthy,silent,deaf,noise,garble,truncate,dribble,split,bad-checksum,wrong-id,twin-id,echo,loopback,duplicate,stale,late,slow,disconnect,refuse,no-echo,hang,no-abort,blocked,obstacle,strain,strain-offset,no-gauges,hot,over-temperature,not-homed,no-board,no-motor,reversed,breakaway,eeprom-worn,erratic,unknown-codes,loop-error,loop-silent,loop-drop,loop-extra,blank-firmware,wrong-echo,missing-echo,extra-byte,monitor-hang --after=none --every=none --wire=none --facts=file --state=file --duration=none --control=file --set=none --transcript=file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity' }
        'sim bus' { $found.opts = '--pty --by-id --tcp --slcan-pty --slcan-tcp --seed --duration --control -h --help'; $found.takes = '--by-id=file --tcp=none --slcan-tcp=none --seed=none --duration=none --control=file'; $found.args = 'file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity' }
        'sim control' { $found.opts = '-h --help'; $found.args = 'file none*'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity' }
        'sim ekso' { $found.opts = '--pty --by-id --tcp --seed --fault --after --every --wire --facts --state --duration --control --set --transcript -h --help'; $found.takes = '--by-id=file --tcp=none --seed=none --fault=choice:healthy,silent,deaf,noise,garble,truncate,dribble,split,bad-checksum,wrong-id,twin-id,echo,loopback,duplicate,stale,late,slow,disconnect,refuse,acknowledge,acknowledge-set,set-unanswered,not-taken,neighbour,pendant,stands-up,fidget,unlisted-codes,unknown-state,stuck-sensor,hip-offset,frozen-clock,clock-jump,reboot,unsolicited,wrong-command,short-body,stray-zero --after=none --every=none --wire=none --facts=file --state=file --duration=none --control=file --set=none --transcript=file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity' }
        'sim exo' { $found.opts = '--pty --by-id --tcp --seed --fault --after --every --wire --facts --state --duration --control --set --transcript -h --help'; $found.takes = '--by-id=file --tcp=none --seed=none --fault=choice:healthy,silent,deaf,noise,garble,truncate,dribble,split,bad-checksum,wrong-id,twin-id,echo,loopback,duplicate,stale,late,slow,disconnect,refuse,strict,block-silent,no-late-frames,save-fails,fresh,foreign,baud-at-1002,faults,hot,blocked,locked-rotor,over-temperature,over-current,motor-abnormal,communication,unknown-bits --after=none --every=none --wire=none --facts=file --state=file --duration=none --control=file --set=none --transcript=file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity' }
        'sim forget' { $found.opts = '-h --help'; $found.args = 'choice:exo,wrist,barrett,ekso,aidin,hand'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity' }
        'sim hand' { $found.opts = '--pty --by-id --tcp --modbus-pty --modbus-tcp --slcan-pty --slcan-tcp --model --seed --fault --after --every --wire --facts --state --duration --control --set --transcript -h --help'; $found.takes = '--by-id=file --tcp=none --modbus-tcp=none --slcan-tcp=none --model=choice:df,tp,f1,dg2 --seed=none --fault=choice:healthy,silent,deaf,noise,garble,truncate,dribble,split,bad-checksum,wrong-id,twin-id,echo,loopback,duplicate,stale,late,slow,disconnect,refuse,strict,block-silent,save-fails,fresh,foreign,faults,hot,blocked,locked-rotor,over-temperature,over-current,motor-abnormal,communication,unknown-bits,force-deaf,stops-short,tactile-dead,tactile-saturated,high-half,rtu-unpacked,no-late-frames,no-ack,bus-off,bel,queue,reports,no-status,damaged-lines,no-adapter --after=none --every=none --wire=none --facts=file --state=file --duration=none --control=file --set=none --transcript=file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity' }
        'sim wrist' { $found.opts = '--pty --by-id --tcp --slcan-pty --slcan-tcp --seed --fault --after --every --wire --facts --state --duration --control --set --transcript -h --help'; $found.takes = '--by-id=file --tcp=none --slcan-tcp=none --seed=none --fault=choice:healthy,silent,deaf,noise,garble,truncate,dribble,split,bad-checksum,wrong-id,twin-id,echo,loopback,duplicate,stale,late,slow,disconnect,refuse,strict,block-silent,no-wrist,save-fails,foreign,faults,hot,blocked,locked-rotor,over-temperature,over-current,motor-abnormal,communication,unknown-bits,no-late-frames,no-ack,bus-off,bel,queue,reports,no-status,damaged-lines,no-adapter --after=none --every=none --wire=none --facts=file --state=file --duration=none --control=file --set=none --transcript=file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity' }
        'plot' { $found.opts = '--only --open -h --help'; $found.takes = '--only=none'; $found.args = 'file*'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'trace' { $found.cmds = 'diff show decode'; $found.opts = '-h --help'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'trace diff' { $found.opts = '--family -h --help'; $found.takes = '--family=choice:exo,wrist,barrett,ekso,aidin,hand'; $found.args = 'file file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'trace show' { $found.opts = '--family --only --grep -h --help'; $found.takes = '--family=choice:exo,wrist,barrett,ekso,aidin,hand --only=choice:errors --grep=none'; $found.args = 'file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'trace decode' { $found.opts = '--from -h --help'; $found.takes = '--from=choice:host,device'; $found.args = 'choice:exo,wrist,barrett,ekso,aidin,hand none*'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'twin' { $found.cmds = 'check'; $found.opts = '-h --help'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'twin check' { $found.opts = '--facts --transcript --against --family -h --help'; $found.takes = '--facts=file --transcript=file --against=link --family=choice:exo,wrist,barrett,ekso,aidin,hand'; $found.args = 'file'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
        'help' { $found.opts = '-h --help'; $found.args = 'none*'; $found.lacks = '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity' }
    }
    $lacks = __handctl_split $found.lacks
    $shared = @((__handctl_split '-p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity') | Where-Object { $lacks -cnotcontains $_ })
    return @{
        cmds = __handctl_split $found.cmds
        opts = @(__handctl_split $found.opts) + $shared
        takes = @(__handctl_split $found.takes) + @(__handctl_split '-p=link --port=link --facts=file -d=device --device=device --id=none --baud=none --timeout=none --deadline=none --retries=none --trace=file --format=choice:table,plain,json,ndjson,csv,openmetrics -o=file --output=file --color=choice:auto,always,never --history=choice:devices,all,off')
        args = __handctl_split $found.args
    }
}

function __handctl_map([string]$family) { # names of its quantities
    $found = @{ read = ''; set = ''; name = ''; elements = ''; values = '' }
    switch -CaseSensitive -Exact ($family) {
        'exo' {
            $found.read = 'id baud_code clear_errors save calibrate system_voltage position_set force_set position_actual force_actual current error temperature'
            $found.set = 'id baud_code position_set force_set'
            $found.name = 'id baud_code clear_errors save factory_reset calibrate system_voltage position_set force_set position_actual force_actual current error temperature'
            $found.elements = 'position_set=little,ring,middle,index,thumb force_set=little,ring,middle,index,thumb position_actual=little,ring,middle,index,thumb,thumb_rotation force_actual=little,ring,middle,index,thumb current=little,ring,middle,index,thumb error=little,ring,middle,index,thumb temperature=little,ring,middle,index,thumb'
            $found.values = 'baud_code=0,1,2'
        }
        'wrist' {
            $found.read = 'pitch_actual yaw_actual current_1024 current_1026 error_1 error_2 temperature_1 temperature_2 yaw_set pitch_set move_time'
            $found.set = 'yaw_set pitch_set move_time'
            $found.name = 'pitch_actual yaw_actual current_1024 current_1026 error_1 error_2 temperature_1 temperature_2 yaw_set pitch_set move_time'
        }
        'barrett' {
            $found.read = 'default_position default_step strain_limit_high strain_limit_low max_open_velocity max_close_velocity strain_limit_high_alias odometer position status strain loop_control_velocity loop_control_velocity_coefficient loop_control_proportional_gain loop_feedback_velocity loop_feedback_velocity_coefficient loop_feedback_strain loop_feedback_absolute_position loop_feedback_delta_position loop_feedback_delta_position_coefficient acceleration close_target enabled filter_derivative_zero filter_integral_pole filter_proportional_gain hold init_hit_count init_offset init_velocity max_position_error open_target sample_time strain_flip stop_time baud_rate loop_feedback_temperature over_temperature_limit temperature peak_temperature uptime_seconds serial_number loop_feedback_delta_discard breakaway_detected breakaway_position breakaway_stop breakaway_acceleration_threshold loop_control_torque loop_feedback_breakaway_position loop_feedback_analog_input firmware DP DS HSG LSG MOV MCV MSG OD P S SG LCV LCVC LCPG LFV LFVC LFS LFAP LFDP LFDPC ACCEL CT EN FDZ FIP FPG HOLD IHIT IOFF IVEL MPE OT SAMPLE SGFLIP TSTOP BAUD LFT OTEMP TEMP PTEMP UPSECS SN LFDPD BD BP BS BDAT LCT LFBP LFAIN VERS'
            $found.set = 'default_position default_step strain_limit_high strain_limit_low max_open_velocity max_close_velocity strain_limit_high_alias loop_control_velocity loop_control_velocity_coefficient loop_control_proportional_gain loop_feedback_velocity loop_feedback_velocity_coefficient loop_feedback_strain loop_feedback_absolute_position loop_feedback_delta_position loop_feedback_delta_position_coefficient acceleration close_target enabled filter_derivative_zero filter_integral_pole filter_proportional_gain hold init_hit_count init_offset init_velocity max_position_error open_target sample_time strain_flip stop_time baud_rate loop_feedback_temperature over_temperature_limit loop_feedback_delta_discard breakaway_stop breakaway_acceleration_threshold loop_control_torque loop_feedback_breakaway_position loop_feedback_analog_input DP DS HSG LSG MOV MCV MSG LCV LCVC LCPG LFV LFVC LFS LFAP LFDP LFDPC ACCEL CT EN FDZ FIP FPG HOLD IHIT IOFF IVEL MPE OT SAMPLE SGFLIP TSTOP BAUD LFT OTEMP LFDPD BS BDAT LCT LFBP LFAIN'
            $found.name = 'default_position default_step strain_limit_high strain_limit_low max_open_velocity max_close_velocity strain_limit_high_alias odometer position status strain loop_control_velocity loop_control_velocity_coefficient loop_control_proportional_gain loop_feedback_velocity loop_feedback_velocity_coefficient loop_feedback_strain loop_feedback_absolute_position loop_feedback_delta_position loop_feedback_delta_position_coefficient acceleration close_target enabled filter_derivative_zero filter_integral_pole filter_proportional_gain hold init_hit_count init_offset init_velocity max_position_error open_target sample_time strain_flip stop_time baud_rate loop_feedback_temperature over_temperature_limit temperature peak_temperature uptime_seconds serial_number loop_feedback_delta_discard breakaway_detected breakaway_position breakaway_stop breakaway_acceleration_threshold loop_control_torque loop_feedback_breakaway_position loop_feedback_analog_input firmware DP DS HSG LSG MOV MCV MSG OD P S SG LCV LCVC LCPG LFV LFVC LFS LFAP LFDP LFDPC ACCEL CT EN FDZ FIP FPG HOLD IHIT IOFF IVEL MPE OT SAMPLE SGFLIP TSTOP BAUD LFT OTEMP TEMP PTEMP UPSECS SN LFDPD BD BP BS BDAT LCT LFBP LFAIN VERS'
            $found.elements = 'default_position=F1,F2,F3,SPREAD DP=F1,F2,F3,SPREAD default_step=F1,F2,F3,SPREAD DS=F1,F2,F3,SPREAD strain_limit_high=F1,F2,F3,SPREAD HSG=F1,F2,F3,SPREAD strain_limit_low=F1,F2,F3,SPREAD LSG=F1,F2,F3,SPREAD max_open_velocity=F1,F2,F3,SPREAD MOV=F1,F2,F3,SPREAD max_close_velocity=F1,F2,F3,SPREAD MCV=F1,F2,F3,SPREAD strain_limit_high_alias=F1,F2,F3,SPREAD MSG=F1,F2,F3,SPREAD odometer=F1,F2,F3,SPREAD OD=F1,F2,F3,SPREAD position=F1,F2,F3,SPREAD P=F1,F2,F3,SPREAD status=F1,F2,F3,SPREAD S=F1,F2,F3,SPREAD strain=F1,F2,F3,SPREAD SG=F1,F2,F3,SPREAD loop_control_velocity=F1,F2,F3,SPREAD LCV=F1,F2,F3,SPREAD loop_control_velocity_coefficient=F1,F2,F3,SPREAD LCVC=F1,F2,F3,SPREAD loop_control_proportional_gain=F1,F2,F3,SPREAD LCPG=F1,F2,F3,SPREAD loop_feedback_velocity=F1,F2,F3,SPREAD LFV=F1,F2,F3,SPREAD loop_feedback_velocity_coefficient=F1,F2,F3,SPREAD LFVC=F1,F2,F3,SPREAD loop_feedback_strain=F1,F2,F3,SPREAD LFS=F1,F2,F3,SPREAD loop_feedback_absolute_position=F1,F2,F3,SPREAD LFAP=F1,F2,F3,SPREAD loop_feedback_delta_position=F1,F2,F3,SPREAD LFDP=F1,F2,F3,SPREAD loop_feedback_delta_position_coefficient=F1,F2,F3,SPREAD LFDPC=F1,F2,F3,SPREAD acceleration=F1,F2,F3,SPREAD ACCEL=F1,F2,F3,SPREAD close_target=F1,F2,F3,SPREAD CT=F1,F2,F3,SPREAD enabled=F1,F2,F3,SPREAD EN=F1,F2,F3,SPREAD filter_derivative_zero=F1,F2,F3,SPREAD FDZ=F1,F2,F3,SPREAD filter_integral_pole=F1,F2,F3,SPREAD FIP=F1,F2,F3,SPREAD filter_proportional_gain=F1,F2,F3,SPREAD FPG=F1,F2,F3,SPREAD hold=F1,F2,F3,SPREAD HOLD=F1,F2,F3,SPREAD init_hit_count=F1,F2,F3,SPREAD IHIT=F1,F2,F3,SPREAD init_offset=F1,F2,F3,SPREAD IOFF=F1,F2,F3,SPREAD init_velocity=F1,F2,F3,SPREAD IVEL=F1,F2,F3,SPREAD max_position_error=F1,F2,F3,SPREAD MPE=F1,F2,F3,SPREAD open_target=F1,F2,F3,SPREAD OT=F1,F2,F3,SPREAD sample_time=F1,F2,F3,SPREAD SAMPLE=F1,F2,F3,SPREAD strain_flip=F1,F2,F3,SPREAD SGFLIP=F1,F2,F3,SPREAD stop_time=F1,F2,F3,SPREAD TSTOP=F1,F2,F3,SPREAD breakaway_detected=F1,F2,F3,SPREAD BD=F1,F2,F3,SPREAD breakaway_position=F1,F2,F3,SPREAD BP=F1,F2,F3,SPREAD breakaway_stop=F1,F2,F3,SPREAD BS=F1,F2,F3,SPREAD breakaway_acceleration_threshold=F1,F2,F3,SPREAD BDAT=F1,F2,F3,SPREAD loop_control_torque=F1,F2,F3,SPREAD LCT=F1,F2,F3,SPREAD loop_feedback_breakaway_position=F1,F2,F3,SPREAD LFBP=F1,F2,F3,SPREAD loop_feedback_analog_input=F1,F2,F3,SPREAD LFAIN=F1,F2,F3,SPREAD'
            $found.values = 'loop_control_velocity=0,1 LCV=0,1 loop_control_proportional_gain=0,1 LCPG=0,1 loop_feedback_velocity=0,1 LFV=0,1 loop_feedback_strain=0,1 LFS=0,1 loop_feedback_absolute_position=0,1 LFAP=0,1 loop_feedback_delta_position=0,1 LFDP=0,1 enabled=0,1 EN=0,1 hold=0,1 HOLD=0,1 strain_flip=0,1 SGFLIP=0,1 baud_rate=6,12,24,48,96,192,384 BAUD=6,12,24,48,96,192,384 loop_feedback_temperature=0,1 LFT=0,1 loop_feedback_delta_discard=0,1 LFDPD=0,1 loop_control_torque=0,1 LCT=0,1 loop_feedback_breakaway_position=0,1 LFBP=0,1 loop_feedback_analog_input=0,1 LFAIN=0,1'
        }
        'ekso' {
            $found.read = 'upper_leg_length lower_leg_length step_length step_height swing_time stand_time knee_flexion hip_flexion forward_shift lateral_shift walk_mode stand_mode target_sounds injury_mode left_swing_assist right_swing_assist left_stance_support right_stance_support swing_complete pilot_id sit_mode lean_allowance torso_pitch torso_roll right_toe_pressure right_heel_pressure left_toe_pressure left_heel_pressure right_hip_x right_hip_y left_hip_x left_hip_y right_hip_current right_hip_angle right_knee_current right_knee_angle left_hip_current left_hip_angle left_knee_current left_knee_angle state foot_state min_state lcd_button_state weight_shift hmi_data va_ref_time boot_time_high boot_time_low steps_taken upright_time walk_time left_max_forward_assist left_assist_gain right_max_forward_assist right_assist_gain left_hip_stance_support left_knee_stance_support right_hip_stance_support right_knee_stance_support left_step_length right_step_length left_swing_time right_swing_time date time'
            $found.set = 'upper_leg_length lower_leg_length step_length step_height swing_time stand_time knee_flexion hip_flexion forward_shift lateral_shift walk_mode stand_mode target_sounds injury_mode left_swing_assist right_swing_assist left_stance_support right_stance_support sit_mode lean_allowance'
            $found.name = 'upper_leg_length lower_leg_length step_length step_height swing_time stand_time knee_flexion hip_flexion forward_shift lateral_shift walk_mode stand_mode target_sounds injury_mode left_swing_assist right_swing_assist left_stance_support right_stance_support swing_complete pilot_id sit_mode lean_allowance torso_pitch torso_roll right_toe_pressure right_heel_pressure left_toe_pressure left_heel_pressure right_hip_x right_hip_y left_hip_x left_hip_y right_hip_current right_hip_angle right_knee_current right_knee_angle left_hip_current left_hip_angle left_knee_current left_knee_angle state foot_state min_state lcd_button_state weight_shift hmi_data va_ref_time boot_time_high boot_time_low steps_taken upright_time walk_time left_max_forward_assist left_assist_gain right_max_forward_assist right_assist_gain left_hip_stance_support left_knee_stance_support right_hip_stance_support right_knee_stance_support left_step_length right_step_length left_swing_time right_swing_time date time'
            $found.values = 'walk_mode=0,1,2,3 stand_mode=0,1 target_sounds=0,1,2,3 injury_mode=0,1,2,3 left_swing_assist=0,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17,18,19,20,21,22,23,24,25,26,27 right_swing_assist=0,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17,18,19,20,21,22,23,24,25,26,27 left_stance_support=0,1,2,3,4,5 right_stance_support=0,1,2,3,4,5 sit_mode=0,1 lean_allowance=0,1,2'
        }
        'aidin' {
            $found.read = 'motor_pos joint_pos task_space_pos current_state sensor_state'
            $found.name = 'motor_pos joint_pos task_space_pos current_state sensor_state hand_mode maxtorque hand_tp_cmd hand_joint_cmd hand_taskspace_cmd hand_tt_cmd'
            $found.elements = 'motor_pos=thumb.m1,thumb.m2,thumb.m3,index.m1,index.m2,index.m3,middle.m1,middle.m2,middle.m3,ring.m1,ring.m2,ring.m3,little.m1,little.m2,little.m3 joint_pos=thumb.q1,thumb.q2,thumb.q3,thumb.q4,index.q1,index.q2,index.q3,index.q4,middle.q1,middle.q2,middle.q3,middle.q4,ring.q1,ring.q2,ring.q3,ring.q4,little.q1,little.q2,little.q3,little.q4 task_space_pos=thumb.x,thumb.y,thumb.z,index.x,index.y,index.z,middle.x,middle.y,middle.z,ring.x,ring.y,ring.z,little.x,little.y,little.z current_state=thumb.m1,thumb.m2,thumb.m3,index.m1,index.m2,index.m3,middle.m1,middle.m2,middle.m3,ring.m1,ring.m2,ring.m3,little.m1,little.m2,little.m3 sensor_state=thumb.fx,thumb.fy,thumb.fz,thumb.tx,thumb.ty,thumb.tz,index.fx,index.fy,index.fz,index.tx,index.ty,index.tz,middle.fx,middle.fy,middle.fz,middle.tx,middle.ty,middle.tz,ring.fx,ring.fy,ring.fz,ring.tx,ring.ty,ring.tz,little.fx,little.fy,little.fz,little.tx,little.ty,little.tz hand_tp_cmd=thumb.m1,thumb.m2,thumb.m3,index.m1,index.m2,index.m3,middle.m1,middle.m2,middle.m3,ring.m1,ring.m2,ring.m3,little.m1,little.m2,little.m3 hand_joint_cmd=thumb.q1,thumb.q2,thumb.q3,thumb.q4,index.q1,index.q2,index.q3,index.q4,middle.q1,middle.q2,middle.q3,middle.q4,ring.q1,ring.q2,ring.q3,ring.q4,little.q1,little.q2,little.q3,little.q4 hand_taskspace_cmd=thumb.x,thumb.y,thumb.z,index.x,index.y,index.z,middle.x,middle.y,middle.z,ring.x,ring.y,ring.z,little.x,little.y,little.z hand_tt_cmd=thumb.m1,thumb.m2,thumb.m3,index.m1,index.m2,index.m3,middle.m1,middle.m2,middle.m3,ring.m1,ring.m2,ring.m3,little.m1,little.m2,little.m3'
        }
        'hand' {
            $found.read = 'id baud_code current_limit default_speed default_force system_voltage stroke_set angle_set force_limit speed_set stroke_actual angle_actual force_actual current error status temperature ip_address'
            $found.set = 'current_limit default_speed default_force stroke_set angle_set force_limit speed_set'
            $found.name = 'id baud_code clear_errors save factory_reset calibrate_force current_limit default_speed default_force system_voltage stroke_set angle_set force_limit speed_set stroke_actual angle_actual force_actual current error status temperature ip_address'
            $found.elements = 'current_limit=little,ring,middle,index,thumb_bend,thumb_rotation default_speed=little,ring,middle,index,thumb_bend,thumb_rotation default_force=little,ring,middle,index,thumb_bend,thumb_rotation stroke_set=little,ring,middle,index,thumb_bend,thumb_rotation angle_set=little,ring,middle,index,thumb_bend,thumb_rotation force_limit=little,ring,middle,index,thumb_bend,thumb_rotation speed_set=little,ring,middle,index,thumb_bend,thumb_rotation stroke_actual=little,ring,middle,index,thumb_bend,thumb_rotation angle_actual=little,ring,middle,index,thumb_bend,thumb_rotation force_actual=little,ring,middle,index,thumb_bend,thumb_rotation current=little,ring,middle,index,thumb_bend,thumb_rotation error=little,ring,middle,index,thumb_bend,thumb_rotation status=little,ring,middle,index,thumb_bend,thumb_rotation temperature=little,ring,middle,index,thumb_bend,thumb_rotation ip_address=a,b,c,d'
        }
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
            __handctl_split 'tcp:// usb: can:socketcan: can:slcan: can:pcan: socket:// replay: fake://exo fake://wrist fake://barrett fake://ekso fake://aidin fake://hand'
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
