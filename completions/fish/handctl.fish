# fish completion of handctl, generated from its command tree: do not edit

function __handctl_node --no-scope-shadowing # PATH: what stands below it; sets cmds opts takes args
    set shared '-p	The link to the device: /dev/ttyUSB0, COM3, usb:VID:PID[:SERIAL], tcp://HOST:PORT, fake://…, replay:FILE, any pyserial URL.' '--port	The link to the device: /dev/ttyUSB0, COM3, usb:VID:PID[:SERIAL], tcp://HOST:PORT, fake://…, replay:FILE, any pyserial URL.' '--fake	Use the built-in simulator of this device.' '--facts	What handctl prove found out about this device: it takes the place of handctl\'s assumptions.' '-d	A named device from the configuration file (see handctl devices). A,B or \'*\' selects several.' '--device	A named device from the configuration file (see handctl devices). A,B or \'*\' selects several.' '--id	Device id.' '--baud	Baud rate of the serial port in bit/s.' '--timeout	Seconds to wait for a reply.' '--deadline	Time limit for the whole command, in seconds.' '--retries	Retry a read up to N times if there is no valid reply. Writes are never retried.' '--trace	Record every byte with its time to FILE. -p replay:FILE plays it back.' '--format	Output format (default: table).' '--json	Same as --format json. A stream prints one row per line.' '--csv	Same as --format csv.' '-o	Write output to FILE instead of stdout. FILE is replaced only when complete.' '--output	Write output to FILE instead of stdout. FILE is replaced only when complete.' '--append	With --csv -o FILE: add the rows to FILE. The header is written once, and the columns must match. With log FILE: record the next trial, into FILE with a number.' '--time	Add the date and time (UTC) to each row of CSV, plain or JSON.' '--no-formulas	In CSV, put \' before any text that a spreadsheet would take for a formula.' '--wide	In CSV, write one row per sample, with a column for each quantity.' '--long	In CSV, write one row per value (the default, except for realtime and watch -o FILE.csv).' '--no-wide	In CSV, write one row per value (the default, except for realtime and watch -o FILE.csv).' '--color	When to use colour (default: auto, which respects NO_COLOR).' '-q	Print only errors to stderr.' '--quiet	Print only errors to stderr.' '-v	Print every byte to stderr, in the form that --trace records.' '--verbose	Print every byte to stderr, in the form that --trace records.' '--debug	Show tracebacks.' '-n	Print the exact bytes that would be written, and send nothing.' '--dry-run	Print the exact bytes that would be written, and send nothing.' '-y	Answer yes to all confirmations.' '--yes	Answer yes to all confirmations.' '--history	Which writes handctl history shows later: those to devices (default), all (simulated devices too), or none (off).' '--assume-identity	Skip the check of the device\'s identity. Only accepted on the command line.'
    set lacks
    set cmds
    set opts
    set takes
    set args
    switch "$argv[1]"
        case ''
            set cmds 'exo	Inspire EH55BF1 exoskeleton hand (RS-232, Bluetooth serial)' 'wrist	Inspire wrist module for dexterous hands (RS-232, RS-485, CAN)' 'barrett	BarrettHand BH8 series (RS-232)' 'ekso	EksoNR DataPort (serial over USB)' 'aidin	AIDIN-hand (TCP, JSON)' 'hand	Inspire RH56 dexterous hands (RS-232, RS-485, CAN, Modbus RTU, Modbus TCP)' 'ports	list serial ports and CAN interfaces, and the programs that use them' 'scan	detect the device on a port: family, baud rate, id' 'top	show all named devices live, those that need attention at the top' 'history	show what handctl wrote to devices earlier, and when' 'prove	find out by experiment what the documents leave open about a device' 'doctor	check this computer and the link, with a remedy for each problem' 'service	guided service: find the device, check it, propose the next step, write a report' 'stop	stop a device at once, even while another handctl command is using it' 'shell	type commands at a prompt, on one open link' 'batch	run many commands on one open link, from a script or stdin' 'devices	name devices in the configuration file: list, add, remove, show' 'completion	print or install the shell completion: bash, zsh, fish, PowerShell' 'sim	serve a simulated device to any client: pty, TCP, slcan' 'plot	draw the curves of a recording as SVG or HTML' 'trace	show, decode or compare recorded transcripts' 'twin	compare the simulator of one particular device with its recording' 'help	show the manual, a guide, a command or the common options'
            set opts '-V	Show the version.' '--version	Show the version.' '-h	Show this help.' '--help	Show this help.'
        case 'exo'
            set cmds 'status	Show a health summary: the present values, with errors decoded.' 'dump	Read every documented quantity.' 'get	Read quantities by name, such as position_actual.index temperature.' 'watch	Show values as they change.' 'describe	List every quantity with address, type, range, access and manual section.' 'stop	Stop the device at once, even while another handctl command is using it.' 'position	Command positions from 0 (bent) to 1000 (open). Asks first.' 'force	Command forces from -1000 (closes the hand) to 1000 (opens it). Asks first.' 'set	Write values by name and read them back. Example: position_set.index=300 force_set=0,0,0,0,0.' 'id	Show the id, or give the hand a NEW one (1 to 254).' 'baud	Show the baud rate code, or set a new RATE: 115200, 57600 or 19200 bit/s.' 'save	Save the present settings to flash and wait for the result (about 1 s).' 'factory-reset	Restore the factory defaults, after a snapshot of the present settings.' 'report	Write one page for a service ticket: status, dump, findings, curves, bytes.' 'doctor	Check this computer, the link and the device.' 'clear-errors	Clear actuator errors and show which remain. Asks first if a finger may move.' 'calibrate	Calibrate forces and positions, guided step by step.' 'scan	Detect a device of this family, with its baud rate and id if it has them.' 'listen	Show what the device sends without a request, decoded. Sends nothing.' 'terminal	Send typed lines, and show every byte that comes, in words.' 'read	Read COUNT bytes (1 to 252) from any ADDRESS. Registers from the manual are decoded.' 'write	Write bytes to ADDRESS, low byte first, and read them back. Asks first.' 'raw	Send exactly these bytes and show the decoded reply. Everything except a read asks first.' 'snapshot	Save the settings of the device, and the set points that it keeps, to FILE.' 'diff	Compare settings: two snapshots, a snapshot and the device, or two devices.' 'restore	Write the settings that differ from a snapshot, and read them back.' 'log	Record values to FILE (CSV) with a sidecar FILE.json. Ctrl-C ends it.' 'export	Turn a log into a file for pandas, BIDS, motion capture and other tools.'
            set opts '-h	Show this help.' '--help	Show this help.'
        case 'exo status'
            set opts '--check	Exit with code 7 if anything is unhealthy.' '--picture	Draw the device, coloured by temperature, force or error.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.'
            set takes --picture=none --limit=none
            set lacks -n --dry-run -y --yes --history
        case 'exo dump'
            set opts '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.'
            set takes --limit=none
            set lacks -n --dry-run -y --yes --history
        case 'exo get'
            set opts '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.'
            set takes --limit=none
            set args 'read:exo*'
            set lacks -n --dry-run -y --yes --history
        case 'exo watch'
            set opts '--rate	Samples per second (0: as fast as the device replies). Default: 10.' '--count	End after N samples.' '--duration	End after S seconds.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.'
            set takes --rate=none --count=none --duration=none --limit=none --until=none
            set args 'read:exo*'
            set lacks -n --dry-run -y --yes --history
        case 'exo describe'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'name:exo*'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'exo stop'
            set opts '-h	Show this help.' '--help	Show this help.'
        case 'exo position'
            set opts '--wait	Wait up to S seconds for the fingers to stop moving. Ctrl-C makes them hold their position.' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.'
            set takes --wait=none --expect=choice:reached,contact,any
            set args 'none*'
        case 'exo force'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'none*'
        case 'exo set'
            set opts '--always	Write settings even if they already have this value.' '-h	Show this help.' '--help	Show this help.'
            set args 'set:exo*'
        case 'exo id'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'none'
        case 'exo baud'
            set opts '--save	Then save to flash. The new baud rate takes effect only after a save and a power-cycle.' '--verify	Wait up to 120 s for the power-cycle, then check that the hand replies at the new baud rate.' '-h	Show this help.' '--help	Show this help.'
            set args 'none'
        case 'exo save'
            set opts '--skip-identity-check	Skip the check that this is an EH55BF1.' '-h	Show this help.' '--help	Show this help.'
        case 'exo factory-reset'
            set opts '--undocumented-address	Write to address 1006, known from the RH56 hand. The manual of this hand gives no address.' '--backup	Write the snapshot to FILE (default: exo-before-reset.json). An existing file is never overwritten.' '--skip-identity-check	Skip the check that this is an EH55BF1.' '-h	Show this help.' '--help	Show this help.'
            set takes --backup=file
        case 'exo report'
            set opts '--watch	Record curves for S seconds (0: none). Default: 3.' '--include-ids	Include serial numbers, the wearer\'s number (pilot id), and the replies that contain them.' '--force	Replace FILE.html if it exists.' '-h	Show this help.' '--help	Show this help.'
            set takes --watch=none
            set args 'file'
            set lacks -n --dry-run -y --yes --history
        case 'exo doctor'
            set opts '--count	Read the device N times to measure the error rate. Default: 100.' '-h	Show this help.' '--help	Show this help.'
            set takes --count=none
            set lacks -n --dry-run -y --yes --history
        case 'exo clear-errors'
            set opts '-h	Show this help.' '--help	Show this help.'
        case 'exo calibrate'
            set opts '-h	Show this help.' '--help	Show this help.'
        case 'exo scan'
            set opts '--ids	Ids to try, such as 1-20 or 1,2,4-12. Default: the one given with --id, otherwise all (on CAN 1 to 254), starting with the usual one.' '--all	Keep searching after the first device, without a time limit, and search a silent line again with longer timeouts.' '-h	Show this help.' '--help	Show this help.'
            set takes --ids=none
            set lacks -n --dry-run -y --yes --history
        case 'exo listen'
            set opts '--count	End after N rows.' '--duration	End after S seconds.' '--find-baud	Try the documented baud rates in turn, and stay at the one at which the bytes make sense and no framing errors are counted. On CAN it tries bitrates without acknowledging, until whole frames come.' '-h	Show this help.' '--help	Show this help.'
            set takes --count=none --duration=none
            set lacks -n --dry-run -y --yes --history
        case 'exo terminal'
            set opts '--hex	Take lines as hexadecimal bytes, and show bytes as such.' '--wait	Listen for S seconds after the last byte. Default: 0.5.' '-h	Show this help.' '--help	Show this help.'
            set takes --wait=none
            set args 'none*'
        case 'exo read'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'none' 'none'
            set lacks -n --dry-run -y --yes --history
        case 'exo write'
            set opts '--undocumented	Allow an address that is not in the manual.' '-h	Show this help.' '--help	Show this help.'
            set args 'none' 'none'
        case 'exo raw'
            set opts '--wait	Listen for S seconds after the last byte. Default: 0.5.' '--force-ambiguous	Also send a frame that means something else to another Inspire device, or that has a value out of range.' '-h	Show this help.' '--help	Show this help.'
            set takes --wait=none
            set args 'none*'
        case 'exo snapshot'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'file'
            set lacks -n --dry-run -y --yes --history
        case 'exo diff'
            set opts '--setpoints	Include set points: commanded positions and forces. Forces need a separate confirmation.' '-h	Show this help.' '--help	Show this help.'
            set args 'file' 'file'
            set lacks -n --dry-run -y --yes --history
        case 'exo restore'
            set opts '--setpoints	Include set points: commanded positions and forces. Forces need a separate confirmation.' '--skip	Leave out this setting of the snapshot, or one element of it. Can be repeated.' '-h	Show this help.' '--help	Show this help.'
            set takes --skip=none
            set args 'file'
        case 'exo log'
            set opts '--rate	Samples per second (0: as fast as the device replies). Default: 0.' '--count	End after N samples.' '--duration	End after S seconds.' '--mark	Mark the first row with TEXT.' '--mark-udp	Each datagram to this UDP port of this computer sets a mark with its text (0: any free port).' '--lsl	Send rows and marks on the Lab Streaming Layer, and record the marks that other programs send there. Needs handctl[lsl].' '--mark-stdin	Each line on standard input sets a mark with its text.' '--silence	End after S seconds without a valid reply. handctl also waits this long for a lost port to come back. Default: 60.' '--force	Overwrite FILE.' '--check	Record nothing: check the recording FILE, and show its segments, its gaps, and how well the device\'s clock and this computer\'s agree. Needs no device. Exit code 7 if it is incomplete or does not match its sidecar.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.'
            set takes --rate=none --count=none --duration=none --mark=none --mark-udp=link --silence=none --limit=none --until=none
            set args 'file' 'read:exo*'
            set lacks -n --dry-run -y --yes --history
        case 'exo export'
            set opts '--to	Output: parquet (columns with types and units, for pandas, needs handctl[parquet]), bids (a BIDS motion dataset), c3d (motion capture, at a constant rate), mcap (messages, for Foxglove and ROS tools, needs handctl[mcap]) or xdf (streams, as LabRecorder writes them).' '--segment	Only segment N.' '--rate	Only for c3d, and mot of an EksoNR: resample to this rate, never across a gap (c3d: default is the rate of the log).' '-h	Show this help.' '--help	Show this help.'
            set takes --to=choice:parquet,bids,c3d,mcap,xdf --segment=none --rate=none
            set args 'file'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'wrist'
            set cmds 'status	Show a health summary: the present values, with errors decoded.' 'dump	Read every documented quantity.' 'get	Read quantities by name, such as pitch_actual yaw_actual.' 'watch	Show values as they change.' 'describe	List every quantity with address, type, range, access and manual section.' 'stop	Stop the device at once, even while another handctl command is using it.' 'move	Move to angles in degrees and wait until the wrist has stopped moving.' 'center	Move both axes to 0 degrees and wait until they have stopped moving.' 'set	Write values by name and read them back. Example: yaw_set=10 pitch_set=-10 move_time=1000.' 'report	Write one page for a service ticket: status, dump, findings, curves, bytes.' 'doctor	Check this computer, the link and the device.' 'scan	Detect a device of this family, with its baud rate and id if it has them.' 'read	Read COUNT bytes (1 to 252) from ADDRESS in the wrist. Registers from the manual are decoded.' 'listen	Show what the device sends without a request, decoded. Sends nothing.' 'terminal	Send typed lines, and show every byte that comes, in words.' 'hand-read	Read COUNT bytes (1 to 252) from ADDRESS in the hand, not in the wrist.' 'write	Write 2, 4 or 6 bytes to addresses 1038 to 1043 and read them back.' 'hand-write	Write bytes to registers of the hand, not of the wrist, and read them back. Asks first.' 'raw	Send exactly these bytes (on CAN: IDENTIFIER#DATA) and show the decoded reply.' 'snapshot	Save the settings of the device, and the set points that it keeps, to FILE.' 'diff	Compare set points (needs --setpoints): two snapshots, a snapshot and the device, or two devices.' 'restore	Write the set points that differ from a snapshot (needs --setpoints).' 'log	Record values to FILE (CSV) with a sidecar FILE.json. Ctrl-C ends it.' 'export	Turn a log into a file for pandas, BIDS, motion capture and other tools.'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
        case 'wrist status'
            set opts '--check	Exit with code 7 if anything is unhealthy.' '--picture	Draw the device, coloured by temperature, force or error.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set takes --picture=none --limit=none
            set lacks -n --dry-run -y --yes --history
        case 'wrist dump'
            set opts '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set takes --limit=none
            set lacks -n --dry-run -y --yes --history
        case 'wrist get'
            set opts '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set takes --limit=none
            set args 'read:wrist*'
            set lacks -n --dry-run -y --yes --history
        case 'wrist watch'
            set opts '--rate	Samples per second (0: as fast as the device replies). Default: 10.' '--count	End after N samples.' '--duration	End after S seconds.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set takes --rate=none --count=none --duration=none --limit=none --until=none
            set args 'read:wrist*'
            set lacks -n --dry-run -y --yes --history
        case 'wrist describe'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'name:wrist*'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'wrist stop'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
        case 'wrist move'
            set opts '--pitch	Pitch from -22.66 to 22.12 degrees, two decimals.' '--yaw	Yaw from -25.50 to 25.50 degrees, two decimals.' '--time	Movement time in ms (default: the time set in the wrist).' '--wait	Wait at most S seconds for the wrist to arrive.' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set takes --pitch=none --yaw=none --time=none --wait=none --expect=choice:reached,contact,any
            set lacks --time
        case 'wrist center'
            set opts '--time	Movement time in ms (default: the time set in the wrist).' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set takes --time=none --expect=choice:reached,contact,any
            set lacks --time
        case 'wrist set'
            set opts '--always	Write settings even if they already have this value.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set args 'set:wrist*'
        case 'wrist report'
            set opts '--watch	Record curves for S seconds (0: none). Default: 3.' '--include-ids	Include serial numbers, the wearer\'s number (pilot id), and the replies that contain them.' '--force	Replace FILE.html if it exists.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set takes --watch=none
            set args 'file'
            set lacks -n --dry-run -y --yes --history
        case 'wrist doctor'
            set opts '--count	Read the device N times to measure the error rate. Default: 100.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set takes --count=none
            set lacks -n --dry-run -y --yes --history
        case 'wrist scan'
            set opts '--ids	Ids to try, such as 1-20 or 1,2,4-12. Default: the one given with --id, otherwise all (on CAN 1 to 254), starting with the usual one.' '--all	Keep searching after the first device, without a time limit, and search a silent line again with longer timeouts.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set takes --ids=none
            set lacks -n --dry-run -y --yes --history
        case 'wrist read'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set args 'none' 'none'
            set lacks -n --dry-run -y --yes --history
        case 'wrist listen'
            set opts '--count	End after N rows.' '--duration	End after S seconds.' '--find-baud	Try the documented baud rates in turn, and stay at the one at which the bytes make sense and no framing errors are counted. On CAN it tries bitrates without acknowledging, until whole frames come.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set takes --count=none --duration=none
            set lacks -n --dry-run -y --yes --history
        case 'wrist terminal'
            set opts '--hex	Take lines as hexadecimal bytes, and show bytes as such.' '--wait	Listen for S seconds after the last byte. Default: 0.5.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set takes --wait=none
            set args 'none*'
        case 'wrist hand-read'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set args 'none' 'none'
            set lacks -n --dry-run -y --yes --history
        case 'wrist write'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set args 'none' 'none'
        case 'wrist hand-write'
            set opts '--undocumented	Allow an address that is not in the manual.' '--force-ambiguous	Also send a frame that means something else to another device or to the hand\'s registers.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set args 'none' 'none'
        case 'wrist raw'
            set opts '--wait	Listen for S seconds after the last byte. Default: 0.5.' '--force-ambiguous	Also send a frame that means something else to another device or to the hand\'s registers.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set takes --wait=none
            set args 'none*'
        case 'wrist snapshot'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set args 'file'
            set lacks -n --dry-run -y --yes --history
        case 'wrist diff'
            set opts '--setpoints	Include set points: commanded positions and forces. Forces need a separate confirmation.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set args 'file' 'file'
            set lacks -n --dry-run -y --yes --history
        case 'wrist restore'
            set opts '--setpoints	Include set points: commanded positions and forces. Forces need a separate confirmation.' '--skip	Leave out this setting of the snapshot, or one element of it. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set takes --skip=none
            set args 'file'
        case 'wrist log'
            set opts '--rate	Samples per second (0: as fast as the device replies). Default: 0.' '--count	End after N samples.' '--duration	End after S seconds.' '--mark	Mark the first row with TEXT.' '--mark-udp	Each datagram to this UDP port of this computer sets a mark with its text (0: any free port).' '--lsl	Send rows and marks on the Lab Streaming Layer, and record the marks that other programs send there. Needs handctl[lsl].' '--mark-stdin	Each line on standard input sets a mark with its text.' '--silence	End after S seconds without a valid reply. handctl also waits this long for a lost port to come back. Default: 60.' '--force	Overwrite FILE.' '--check	Record nothing: check the recording FILE, and show its segments, its gaps, and how well the device\'s clock and this computer\'s agree. Needs no device. Exit code 7 if it is incomplete or does not match its sidecar.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.'
            set takes --rate=none --count=none --duration=none --mark=none --mark-udp=link --silence=none --limit=none --until=none
            set args 'file' 'read:wrist*'
            set lacks -n --dry-run -y --yes --history
        case 'wrist export'
            set opts '--to	Output: parquet (columns with types and units, for pandas, needs handctl[parquet]), bids (a BIDS motion dataset), c3d (motion capture, at a constant rate), mcap (messages, for Foxglove and ROS tools, needs handctl[mcap]) or xdf (streams, as LabRecorder writes them).' '--segment	Only segment N.' '--rate	Only for c3d, and mot of an EksoNR: resample to this rate, never across a gap (c3d: default is the rate of the log).' '-h	Show this help.' '--help	Show this help.'
            set takes --to=choice:parquet,bids,c3d,mcap,xdf --segment=none --rate=none
            set args 'file'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'barrett'
            set cmds 'status	Show a health summary: the present values, with errors decoded.' 'dump	Read every documented quantity.' 'get	Read quantities by name, such as P SG.F1 temperature.' 'watch	Show values as they change.' 'describe	List all parameters with range, defaults, access and manual section.' 'version	Show the firmware version.' 'errors	Explain status codes as the manual does. CODE can be a sum. Needs no device.' 'help	Show what the hand and the manual say about COMMAND or a parameter.' 'fingertips	Show each fingertip\'s position in mm and its joint angles (§9.5, §9.6).' 'stop	Stop the hand at once, even while another handctl command is using it.' 'init	Initialize the motors (HI): the fingers open fully. Run it after power-on or reset.' 'open	Open to the open target (parameter OT).' 'close	Close to the close target (parameter CT). To grip an object, add --expect contact.' 'move	Move all motors to POSITION in counts (default: the parameter DP), or each motor to its own: F1=9000 F2=500.' 'home	Move to position 0.' 'step-open	Open by COUNTS (default: the parameter DS).' 'step-close	Close by COUNTS (default: the parameter DS).' 'torque-open	Open under torque control until the motors stall.' 'torque-close	Close under torque control until the motors stall.' 'realtime	Run the RealTime loop (LOOP), shown live or written as NDJSON or CSV.' 'set	Set parameters in RAM and read them back.' 'save	Save the settings from RAM to EEPROM. Asks first.' 'baud	Show the baud rate, or change it.' 'load	Load the saved settings from EEPROM into RAM (FLOAD, PLOAD).' 'defaults	Set all parameters in RAM to their factory values (FDEF, PDEF). Saves nothing.' 'report	Write one page for a service ticket: status, dump, findings, curves, bytes.' 'doctor	Check this computer, the link and the device.' 'diagnose	Run the manual\'s troubleshooting checks (§8). With SYMPTOM, also list the steps to do by hand.' 'maintenance	Show the strokes of each motor and any maintenance that is due (§7).' 'strain	Measure the strain gauges without load, and show how to adjust them (§7.4).' 'scan	Detect a device of this family, with its baud rate and id if it has them.' 'listen	Show what the device sends without a request, decoded. Sends nothing.' 'terminal	Send typed lines, and show every byte that comes, in words.' 'reset	Restart the firmware, like a power-cycle, and show its banner. Asks first.' 'gcl	Send GCL commands, one per argument.' 'firmware	Check a firmware file, or load it into the hand (§3.7).' 'first-light	Bring a hand from the cupboard into use, step by step. MOVES the hand.' 'snapshot	Save the settings of the device, and the set points that it keeps, to FILE.' 'diff	Compare settings: two snapshots, a snapshot and the device, or two devices.' 'restore	Restore to RAM the values that differ from a snapshot, and read them back.' 'log	Record values to FILE (CSV) with a sidecar FILE.json. Ctrl-C ends it.' 'export	Turn a log into a file for pandas, BIDS, motion capture and other tools.'
            set opts '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set lacks --id
        case 'barrett status'
            set opts '--check	Exit with code 7 if anything is unhealthy.' '--picture	Draw the device, coloured by temperature, force or error.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--include-ids	Include the serial number in device of the JSON.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --picture=none --limit=none
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett dump'
            set opts '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--include-ids	Include the serial number in device of the JSON.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --limit=none
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett get'
            set opts '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --limit=none
            set args 'read:barrett*'
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett watch'
            set opts '--rate	Samples per second (0: as fast as the device replies). Default: 10.' '--count	End after N samples.' '--duration	End after S seconds.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --rate=none --count=none --duration=none --limit=none --until=none
            set args 'read:barrett*'
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett describe'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'name:barrett*'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'barrett version'
            set opts '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett errors'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'none'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'barrett help'
            set opts '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set args 'none'
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett fingertips'
            set opts '--positions	Use these counts instead of the hand\'s. Needs no device.' '--breakaway	With --positions: the clutch broke away at COUNTS.' '--live	Keep reading: a live view on a terminal, otherwise a stream.' '--rate	Samples per second (0: as fast as the device replies). Default: 10.' '--count	End after N samples.' '--duration	End after S seconds.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --positions=none --breakaway=none --rate=none --count=none --duration=none --limit=none --until=none
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett stop'
            set opts '--motors	Motors: digits 1 to 4, G for the fingers, S for the spread (default: all).' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none
            set lacks --id
        case 'barrett init'
            set opts '--force	Move even if faster than IVEL allows, or if the limits OT and CT block or reverse it.' '--motors	Motors: digits 1 to 4, G for the fingers, S for the spread (default: all).' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none --expect=choice:reached,contact,any
            set lacks --id
        case 'barrett open'
            set opts '--force	Move even if faster than IVEL allows, or if the limits OT and CT block or reverse it.' '--motors	Motors: digits 1 to 4, G for the fingers, S for the spread (default: all).' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none --expect=choice:reached,contact,any
            set lacks --id
        case 'barrett close'
            set opts '--force	Move even if faster than IVEL allows, or if the limits OT and CT block or reverse it.' '--motors	Motors: digits 1 to 4, G for the fingers, S for the spread (default: all).' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none --expect=choice:reached,contact,any
            set lacks --id
        case 'barrett move'
            set opts '--force	Move even if faster than IVEL allows, or if the limits OT and CT block or reverse it.' '--motors	Motors: digits 1 to 4, G for the fingers, S for the spread (default: all).' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none --expect=choice:reached,contact,any
            set args 'none*'
            set lacks --id
        case 'barrett home'
            set opts '--force	Move even if faster than IVEL allows, or if the limits OT and CT block or reverse it.' '--motors	Motors: digits 1 to 4, G for the fingers, S for the spread (default: all).' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none --expect=choice:reached,contact,any
            set lacks --id
        case 'barrett step-open'
            set opts '--force	Move even if faster than IVEL allows, or if the limits OT and CT block or reverse it.' '--motors	Motors: digits 1 to 4, G for the fingers, S for the spread (default: all).' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none --expect=choice:reached,contact,any
            set args 'none*'
            set lacks --id
        case 'barrett step-close'
            set opts '--force	Move even if faster than IVEL allows, or if the limits OT and CT block or reverse it.' '--motors	Motors: digits 1 to 4, G for the fingers, S for the spread (default: all).' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none --expect=choice:reached,contact,any
            set args 'none*'
            set lacks --id
        case 'barrett torque-open'
            set opts '--force	Move even if faster than IVEL allows, or if the limits OT and CT block or reverse it.' '--motors	Motors: digits 1 to 4, G for the fingers, S for the spread (default: all).' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none --expect=choice:reached,contact,any
            set lacks --id
        case 'barrett torque-close'
            set opts '--motors	Motors: digits 1 to 4, G for the fingers, S for the spread (default: all).' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none --expect=choice:reached,contact,any
            set lacks --id
        case 'barrett realtime'
            set opts '--motors	Motors in the loop: digits 1 to 4, G for the fingers, S for the spread (default: all).' '--send	Values in control blocks: velocity, gain. velocity@12 limits it to some motors.' '--receive	Values in feedback: velocity, strain, position, delta, temperature, none. strain@12 limits it to some motors (default: the hand\'s own flags).' '--angles	Also show the joint angles in degrees, calculated from the positions. See ANGLES.' '--velocity	Constant control velocity, -127 to 127. Examples: 20 (all motors), 20,5 (in order), F1=20,F2=5.' '--gain	Constant proportional gain, 0 to 255, in the same form.' '--control	Control values as CSV or JSON lines (t, velocity.F1 …). - is stdin. Live lines (without t) are valid for 1 s, then velocity is 0.' '--law	A control law, such as \'velocity.F1 = clamp((9000 - P.F1)/20, -40, 40)\'. Can be repeated. See LAWS.' '--until	End when this is true, such as \'abs(P.F1 - 9000) < 50\'. Same terms as a law.' '--log	Record the rows to a new FILE (CSV) with a sidecar FILE.json, as log does.' '--mark	Mark the first row with TEXT.' '--mark-udp	Each datagram to this UDP port of this computer sets a mark with its text (0: any free port).' '--lsl	Send rows and marks on the Lab Streaming Layer, and record the marks that other programs send there. Needs handctl[lsl].' '--mark-stdin	Each line on standard input sets a mark with its text.' '--measure	Exchange N blocks and show only the timing and, if velocity and position are received, the estimated velocity unit.' '--sequential	Wait for the complete feedback before sending the next block, or only for the * that begins it. Default: sequential when driving, overlapped when watching. Overlapped driving starts with a self-test that moves nothing.' '--overlapped	Wait for the complete feedback before sending the next block, or only for the * that begins it. Default: sequential when driving, overlapped when watching. Overlapped driving starts with a self-test that moves nothing.' '--no-guard	Switch off a guard: stall, window, strain, opening, heat, all. See GUARDS.' '--force	Same as --no-guard opening. This may deform the clutch permanently.' '--delta-unit	Counts per unit of delta (LFDPC). Default: the hand\'s own setting, or a larger one if the delta of a fast motor would not fit into its byte.' '--init	First initialize the motors (HI): the fingers open fully.' '--hold	Leave the motors powered at the end.' '--may-suspend	Do not stop the motors when this command is suspended (SIGSTOP) for 0.5 s.' '--rate	Samples per second (0: as fast as the device replies). Default: 0.' '--count	End after N samples.' '--duration	End after S seconds.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none --send=none --receive=none --velocity=none --gain=none --control=file --law=none --until=none --log=file --mark=none --mark-udp=link --measure=none --no-guard=choice:stall,window,strain,opening,heat,all --delta-unit=none --rate=none --count=none --duration=none
            set lacks --id
        case 'barrett set'
            set opts '--motors	Motors: digits 1 to 4, G for the fingers, S for the spread (default: all).' '--force	Write a value the manual warns about, or save unchanged values.' '--always	Write settings even if they already have this value.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none
            set args 'set:barrett*'
            set lacks --id
        case 'barrett save'
            set opts '--motors	Motors: digits 1 to 4, G for the fingers, S for the spread (default: all).' '--force	Write a value the manual warns about, or save unchanged values.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none
            set lacks --id
        case 'barrett baud'
            set opts '--save	Also save the baud rate to EEPROM, so the hand starts with it.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set args 'none'
            set lacks --id
        case 'barrett load'
            set opts '--motors	Motors: digits 1 to 4, G for the fingers, S for the spread (default: all).' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none
            set lacks --id
        case 'barrett defaults'
            set opts '--motors	Motors: digits 1 to 4, G for the fingers, S for the spread (default: all).' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none
            set lacks --id
        case 'barrett report'
            set opts '--watch	Record curves for S seconds (0: none). Default: 3.' '--include-ids	Include serial numbers, the wearer\'s number (pilot id), and the replies that contain them.' '--force	Replace FILE.html if it exists.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --watch=none
            set args 'file'
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett doctor'
            set opts '--count	Read the device N times to measure the error rate. Default: 100.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --count=none
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett diagnose'
            set opts '--list	List the symptoms in the manual. Needs no device.' '--move	MOVES the hand: also run the movements that test the symptom. Asks first.' '--motors	Fingers that --move may move. Default: G.' '--hand	Name for this hand in the journal if its serial number is 0.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --motors=none --hand=none
            set args 'none'
            set lacks --id
        case 'barrett maintenance'
            set opts '--greased	Record points as greased today: all, worm, spur, motor-spur, palm, or spur.F1 for one finger. Separate points with commas.' '--steps	List the steps of a procedure, with manual sections. Needs no device.' '--check	Exit with code 7 if anything is due or too hot.' '--hand	Name for this hand in the journal if its serial number is 0.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --greased=none --steps=choice:lubrication,fasteners,pretension,strain,firmware --hand=none
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett strain'
            set opts '--open	MOVES the hand: initialize it, free the spread and open the fingers first.' '--live	Show the readings live while you turn the potentiometer. The bar spans 100 to 140.' '--check	Exit with code 7 if a reading is outside 100 to 140.' '--rate	Samples per second (0: as fast as the device replies). Default: 10.' '--count	End after N samples.' '--duration	End after S seconds.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --rate=none --count=none --duration=none --limit=none --until=none
            set lacks --id
        case 'barrett scan'
            set opts '--ids	Ids to try, such as 1-20 or 1,2,4-12. Default: the one given with --id, otherwise all (on CAN 1 to 254), starting with the usual one.' '--all	Keep searching after the first device, without a time limit, and search a silent line again with longer timeouts.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --ids=none
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett listen'
            set opts '--count	End after N rows.' '--duration	End after S seconds.' '--find-baud	Try the documented baud rates in turn, and stay at the one at which the bytes make sense and no framing errors are counted. On CAN it tries bitrates without acknowledging, until whole frames come.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --count=none --duration=none
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett terminal'
            set opts '--hex	Take lines as hexadecimal bytes, and show bytes as such.' '--wait	Listen for S seconds after the last byte. Default: 0.5.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --wait=none
            set args 'none*'
            set lacks --id
        case 'barrett reset'
            set opts '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set lacks --id
        case 'barrett gcl'
            set opts '--keep-going	Keep going after an error.' '--file	Send the lines of this script.' '--force	Send values that set, and openings that open, would refuse.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --file=file
            set args 'none*'
            set lacks --id
        case 'barrett firmware'
            set cmds 'check	Check an S-record FILE. Needs no device.' 'download	Load a firmware FILE into the hand.'
            set opts '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set lacks --id
        case 'barrett firmware check'
            set opts '--force	Accept a file that has no end record.' '-h	Show this help.' '--help	Show this help.'
            set args 'file'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'barrett firmware download'
            set opts '--force	Load a file even if it has no end record.' '--expect	Exit with code 7 unless the hand then reports this version, such as 4.34.' '--window	Bytes to send ahead of their echo, 1 to 4. 2 halves the time. More than 2 has not been tried on hardware. Default: 1.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --expect=none --window=none
            set args 'file'
            set lacks --id
        case 'barrett first-light'
            set opts '--skip	Skip this step. Can be repeated. Steps: power-on, firmware, settings, temperature, init, strain, origin, position-at-stop, finger-speed, spread-speed, highest-speed, early-breakaway, breakaway, grease.' '--repeat	Repeat each reading step N times. All of them must agree. Default: 2.' '--identify	Keep the serial number and other identifying data in the facts file.' '--keep	Also keep the facts in FILE (JSON), as prove -o does, for --facts and prove diff.' '--hand	Name for this hand in the journal if its serial number is 0.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --skip=choice:power-on,firmware,settings,temperature,init,strain,origin,position-at-stop,finger-speed,spread-speed,highest-speed,early-breakaway,breakaway,grease --repeat=none --keep=file --hand=none
            set args 'link'
            set lacks --id
        case 'barrett snapshot'
            set opts '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set args 'file'
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett diff'
            set opts '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set args 'file' 'file'
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett restore'
            set opts '--save	Then save to EEPROM.' '--force	Write a value the manual warns about, or save unchanged values.' '--skip	Leave out this setting of the snapshot, or one element of it. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --skip=none
            set args 'file'
            set lacks --id
        case 'barrett log'
            set opts '--rate	Samples per second (0: as fast as the device replies). Default: 0.' '--count	End after N samples.' '--duration	End after S seconds.' '--mark	Mark the first row with TEXT.' '--mark-udp	Each datagram to this UDP port of this computer sets a mark with its text (0: any free port).' '--lsl	Send rows and marks on the Lab Streaming Layer, and record the marks that other programs send there. Needs handctl[lsl].' '--mark-stdin	Each line on standard input sets a mark with its text.' '--silence	End after S seconds without a valid reply. handctl also waits this long for a lost port to come back. Default: 60.' '--force	Overwrite FILE.' '--check	Record nothing: check the recording FILE, and show its segments, its gaps, and how well the device\'s clock and this computer\'s agree. Needs no device. Exit code 7 if it is incomplete or does not match its sidecar.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--interrupt	Allow a read-only command to interrupt a movement in progress (it sends ^C). Without it the hand keeps moving.'
            set takes --rate=none --count=none --duration=none --mark=none --mark-udp=link --silence=none --limit=none --until=none
            set args 'file' 'read:barrett*'
            set lacks --id -n --dry-run -y --yes --history
        case 'barrett export'
            set opts '--to	Output: parquet (columns with types and units, for pandas, needs handctl[parquet]), bids (a BIDS motion dataset), c3d (motion capture, at a constant rate), mcap (messages, for Foxglove and ROS tools, needs handctl[mcap]) or xdf (streams, as LabRecorder writes them).' '--segment	Only segment N.' '--rate	Only for c3d, and mot of an EksoNR: resample to this rate, never across a gap (c3d: default is the rate of the log).' '-h	Show this help.' '--help	Show this help.'
            set takes --to=choice:parquet,bids,c3d,mcap,xdf --segment=none --rate=none
            set args 'file'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'ekso'
            set cmds 'status	Show a health summary: posture, joints, feet and unusual settings.' 'dump	Read every documented quantity.' 'get	Read quantities by name, such as step_length left_knee_angle 216.' 'watch	Show values as they change.' 'describe	List all words with message, ParameterID, type, codes and aliases.' 'time	Show the device\'s time of day.' 'date	Show the device\'s date.' 'settings	Show all settings (GetSettings, 22 words).' 'data	Show the current sensor values (GetData, 27 words).' 'feedback	Show step counts, times and assistance (GetFeedback, 17 words).' 'policy	Show the checks and confirmations before a write. Needs no device.' 'stop	Send CancelAction, which MAY NOT STOP THE DEVICE: use its own controls.' 'set	Write one setting, with every check.' 'cancel	Send CancelAction once. This MAY NOT STOP THE DEVICE.' 'report	Write one page for a service ticket: status, dump, findings, curves, bytes.' 'doctor	Check this computer, the link and the device.' 'scan	Detect a device of this family, with its baud rate and id if it has them.' 'listen	Show what the device sends without a request, decoded. Sends nothing.' 'terminal	Send typed lines, and show every byte that comes, in words.' 'snapshot	Save the settings of the device, and the set points that it keeps, to FILE.' 'diff	Compare settings: two snapshots, a snapshot and the device, or two devices.' 'restore	Write the settings that differ from a snapshot, one by one.' 'log	Record GetData to FILE (CSV) with a sidecar FILE.json. Ctrl-C ends it.' 'export	Turn a log into a file for OpenSim, pandas, BIDS and other tools. Needs no device.' 'gait	Find the strides in a log: cadence, stance, symmetry, variability. Needs no device.'
            set opts '-h	Show this help.' '--help	Show this help.'
            set lacks --id
        case 'ekso status'
            set opts '--check	Exit with code 7 if anything is unhealthy.' '--picture	Draw the device, coloured by temperature, force or error.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --picture=none --limit=none --length-mode=none
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso dump'
            set opts '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --limit=none --length-mode=none
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso get'
            set opts '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --limit=none --length-mode=none
            set args 'read:ekso*'
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso watch'
            set opts '--rate	Samples per second (0: as fast as the device replies). Default: 10.' '--count	End after N samples.' '--duration	End after S seconds.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --rate=none --count=none --duration=none --limit=none --until=none --length-mode=none
            set args 'read:ekso*'
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso describe'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'name:ekso*'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'ekso time'
            set opts '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --length-mode=none
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso date'
            set opts '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --length-mode=none
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso settings'
            set opts '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --length-mode=none
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso data'
            set opts '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --length-mode=none
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso feedback'
            set opts '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --length-mode=none
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso policy'
            set opts '--audit	Audit log to check (default: ekso-audit.jsonl in the user\'s state folder).' '-h	Show this help.' '--help	Show this help.'
            set takes --audit=file
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'ekso stop'
            set opts '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --length-mode=none
            set lacks --id
        case 'ekso set'
            set opts '--operator	Your name, for the audit log. Required with --yes.' '--audit	A second audit log, as well as ekso-audit.jsonl in the user\'s state folder. Without a log no setting is written. The step limits use the last writes of all users of this computer, so they apply to every port and FILE.' '--override-step-limit	Allow a larger change than this tool\'s policy does, except for leg lengths.' '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --operator=none --audit=file --length-mode=none
            set args 'set:ekso*'
            set lacks --id
        case 'ekso cancel'
            set opts '--word	Command word, not 0. 0x0100 is 256. Default: 256.' '--operator	Your name, for the audit log. Required with --yes.' '--audit	A second audit log, as well as ekso-audit.jsonl in the user\'s state folder. Without a log no setting is written. The step limits use the last writes of all users of this computer, so they apply to every port and FILE.' '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --word=none --operator=none --audit=file --length-mode=none
            set lacks --id
        case 'ekso report'
            set opts '--watch	Record curves for S seconds (0: none). Default: 3.' '--include-ids	Include serial numbers, the wearer\'s number (pilot id), and the replies that contain them.' '--force	Replace FILE.html if it exists.' '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --watch=none --length-mode=none
            set args 'file'
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso doctor'
            set opts '--count	Read the device N times to measure the error rate. Default: 100.' '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --count=none --length-mode=none
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso scan'
            set opts '--ids	Ids to try, such as 1-20 or 1,2,4-12. Default: the one given with --id, otherwise all (on CAN 1 to 254), starting with the usual one.' '--all	Keep searching after the first device, without a time limit, and search a silent line again with longer timeouts.' '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --ids=none --length-mode=none
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso listen'
            set opts '--count	End after N rows.' '--duration	End after S seconds.' '--find-baud	Try the documented baud rates in turn, and stay at the one at which the bytes make sense and no framing errors are counted. On CAN it tries bitrates without acknowledging, until whole frames come.' '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --count=none --duration=none --length-mode=none
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso terminal'
            set opts '--hex	Take lines as hexadecimal bytes, and show bytes as such.' '--wait	Listen for S seconds after the last byte. Default: 0.5.' '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --wait=none --length-mode=none
            set args 'none*'
            set lacks --id
        case 'ekso snapshot'
            set opts '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --length-mode=none
            set args 'file'
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso diff'
            set opts '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --length-mode=none
            set args 'file' 'file'
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso restore'
            set opts '--operator	Your name, for the audit log. Required with --yes.' '--audit	A second audit log, as well as ekso-audit.jsonl in the user\'s state folder. Without a log no setting is written. The step limits use the last writes of all users of this computer, so they apply to every port and FILE.' '--override-step-limit	Allow a larger change than this tool\'s policy does, except for leg lengths.' '--skip	Leave out this setting of the snapshot, or one element of it. Can be repeated.' '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --operator=none --audit=file --skip=none --length-mode=none
            set args 'file'
            set lacks --id
        case 'ekso log'
            set opts '--rate	Samples per second (0: as fast as the device replies). Default: 0.' '--count	End after N samples.' '--duration	End after S seconds.' '--mark	Mark the first row with TEXT.' '--mark-udp	Each datagram to this UDP port of this computer sets a mark with its text (0: any free port).' '--lsl	Send rows and marks on the Lab Streaming Layer, and record the marks that other programs send there. Needs handctl[lsl].' '--mark-stdin	Each line on standard input sets a mark with its text.' '--silence	End after S seconds without a valid reply. handctl also waits this long for a lost port to come back. Default: 60.' '--force	Overwrite FILE.' '--check	Record nothing: check the recording FILE, and show its segments, its gaps, and how well the device\'s clock and this computer\'s agree. Needs no device. Exit code 7 if it is incomplete or does not match its sidecar.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '--raw	Append the 27 raw words to each row.' '--include-pilot-id	Keep the wearer\'s number (pilot id) in the sidecar.' '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '-h	Show this help.' '--help	Show this help.'
            set takes --rate=none --count=none --duration=none --mark=none --mark-udp=link --silence=none --limit=none --until=none --length-mode=none
            set args 'file'
            set lacks --id -n --dry-run -y --yes --history
        case 'ekso export'
            set opts '--to	Output: mot (OpenSim motion file), csv (the columns of the log), parquet (columns with types and units, for pandas, needs handctl[parquet]), bids (a BIDS motion dataset), c3d (motion capture, at a constant rate), mcap (messages, for Foxglove and ROS tools, needs handctl[mcap]) or xdf (streams, as LabRecorder writes them). --format is the older name.' '--format	Output: mot (OpenSim motion file), csv (the columns of the log), parquet (columns with types and units, for pandas, needs handctl[parquet]), bids (a BIDS motion dataset), c3d (motion capture, at a constant rate), mcap (messages, for Foxglove and ROS tools, needs handctl[mcap]) or xdf (streams, as LabRecorder writes them). --format is the older name.' '--si	With csv: metres and radians instead of inches and degrees.' '--segment	Only segment N.' '--knee-sign	With mot: sign of knee flexion in your model (default 1, as in the device; gait2392 needs -1).' '--rate	Only for c3d, and mot of an EksoNR: resample to this rate, never across a gap (c3d: default is the rate of the log).' '-h	Show this help.' '--help	Show this help.'
            set takes --to=choice:mot,csv,parquet,bids,c3d,mcap,xdf --format=choice:mot,csv,parquet,bids,c3d,mcap,xdf --segment=none --knee-sign=choice:1,-1 --rate=none
            set args 'file'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format -n --dry-run -y --yes --history --assume-identity
        case 'ekso gait'
            set opts '--steps	Write every stride, counted or not, to FILE (CSV).' '--page	Write the curves, figures and strides not counted to FILE (HTML).' '-h	Show this help.' '--help	Show this help.'
            set takes --steps=file --page=file
            set args 'file' 'file'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'aidin'
            set cmds 'status	Show a health summary: the present values, with errors decoded.' 'dump	Read every documented quantity.' 'get	Read quantities by name, such as joint_pos.index sensor_state.fz.' 'watch	Show values as they change.' 'describe	List every quantity with address, type, range, access and manual section.' 'stop	Stop the device at once, even while another handctl command is using it.' 'home	DRIVE ALL FINGERS OPEN for 3.5 s, then make that position the origin.' 'initial	Open all fingers to the origin set by homing. Asks first. Ctrl-C stops the hand.' 'encoders	Move motors to encoder counts.' 'joints	Move joints to angles in degrees.' 'fingertips	Move fingertips to coordinates in mm.' 'currents	Drive motors by current: NO POSITION LIMIT.' 'bias	Set the sensors to 0. Touch nothing: any load is subtracted from all later values.' 'max-torque	Set the maximum torque (output current), 0 to 1000 in units of 0.1 %.' 'report	Write one page for a service ticket: status, dump, findings, curves, bytes.' 'doctor	Check this computer, the link and the device.' 'scan	Detect a device of this family, with its baud rate and id if it has them.' 'listen	Show what the device sends without a request, decoded. Sends nothing.' 'terminal	Send typed lines, and show every byte that comes, in words.' 'check	Move each motor a little and back, one after the other, and report findings.' 'log	Record values to FILE (CSV) with a sidecar FILE.json. Ctrl-C ends it.' 'export	Turn a log into a file for pandas, BIDS, motion capture and other tools.'
            set opts '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set lacks --id --baud
        case 'aidin status'
            set opts '--check	Exit with code 7 if anything is unhealthy.' '--picture	Draw the device, coloured by temperature, force or error.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --picture=none --limit=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set lacks --id --baud -n --dry-run -y --yes --history
        case 'aidin dump'
            set opts '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --limit=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set lacks --id --baud -n --dry-run -y --yes --history
        case 'aidin get'
            set opts '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --limit=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set args 'read:aidin*'
            set lacks --id --baud -n --dry-run -y --yes --history
        case 'aidin watch'
            set opts '--rate	Samples per second (0: as fast as the device replies). Default: 10.' '--count	End after N samples.' '--duration	End after S seconds.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --rate=none --count=none --duration=none --limit=none --until=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set args 'read:aidin*'
            set lacks --id --baud -n --dry-run -y --yes --history
        case 'aidin describe'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'name:aidin*'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'aidin stop'
            set opts '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set lacks --id --baud
        case 'aidin home'
            set opts '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set lacks --id --baud
        case 'aidin initial'
            set opts '--assume-homed	Continue even if the encoders are out of range, as they are before homing.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set lacks --id --baud
        case 'aidin encoders'
            set opts '--assume-homed	Continue even if the encoders are out of range, as they are before homing.' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --expect=choice:reached,contact,any --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set args 'none*'
            set lacks --id --baud
        case 'aidin joints'
            set opts '--rad	Values are in radians, not degrees.' '--assume-homed	Continue even if the encoders are out of range, as they are before homing.' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --expect=choice:reached,contact,any --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set args 'none*'
            set lacks --id --baud
        case 'aidin fingertips'
            set opts '--assume-homed	Continue even if the encoders are out of range, as they are before homing.' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --expect=choice:reached,contact,any --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set args 'none*'
            set lacks --id --baud
        case 'aidin currents'
            set opts '--cap	Refuse currents above N. Default: 300.' '--duration	How long the currents flow after the ramp. Default: 1.' '--ramp-down	Make Ctrl-C ramp the currents down to 0 before it stops.' '--may-suspend	Do not stop the motors when this command is suspended (SIGSTOP) for 0.5 s.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --cap=none --duration=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set args 'none*'
            set lacks --id --baud
        case 'aidin bias'
            set opts '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set lacks --id --baud
        case 'aidin max-torque'
            set opts '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set args 'none'
            set lacks --id --baud
        case 'aidin report'
            set opts '--watch	Record curves for S seconds (0: none). Default: 3.' '--include-ids	Include serial numbers, the wearer\'s number (pilot id), and the replies that contain them.' '--force	Replace FILE.html if it exists.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --watch=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set args 'file'
            set lacks --id --baud -n --dry-run -y --yes --history
        case 'aidin doctor'
            set opts '--count	Read the device N times to measure the error rate. Default: 100.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --count=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set lacks --id --baud -n --dry-run -y --yes --history
        case 'aidin scan'
            set opts '--ids	Ids to try, such as 1-20 or 1,2,4-12. Default: the one given with --id, otherwise all (on CAN 1 to 254), starting with the usual one.' '--all	Keep searching after the first device, without a time limit, and search a silent line again with longer timeouts.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --ids=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set lacks --id --baud -n --dry-run -y --yes --history
        case 'aidin listen'
            set opts '--count	End after N rows.' '--duration	End after S seconds.' '--find-baud	Try the documented baud rates in turn, and stay at the one at which the bytes make sense and no framing errors are counted. On CAN it tries bitrates without acknowledging, until whole frames come.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --count=none --duration=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set lacks --id --baud -n --dry-run -y --yes --history
        case 'aidin terminal'
            set opts '--hex	Take lines as hexadecimal bytes, and show bytes as such.' '--wait	Listen for S seconds after the last byte. Default: 0.5.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --wait=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set args 'none*'
            set lacks --id --baud
        case 'aidin check'
            set opts '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set lacks --id --baud
        case 'aidin log'
            set opts '--rate	Samples per second (0: as fast as the device replies). Default: 0.' '--count	End after N samples.' '--duration	End after S seconds.' '--mark	Mark the first row with TEXT.' '--mark-udp	Each datagram to this UDP port of this computer sets a mark with its text (0: any free port).' '--lsl	Send rows and marks on the Lab Streaming Layer, and record the marks that other programs send there. Needs handctl[lsl].' '--mark-stdin	Each line on standard input sets a mark with its text.' '--silence	End after S seconds without a valid reply. handctl also waits this long for a lost port to come back. Default: 60.' '--force	Overwrite FILE.' '--check	Record nothing: check the recording FILE, and show its segments, its gaps, and how well the device\'s clock and this computer\'s agree. Needs no device. Exit code 7 if it is incomplete or does not match its sidecar.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--exchange	When the hand sends feedback: without a request (stream), on request (poll), or only after a command (command). auto (default) detects it.' '--poll-json	The JSON object that requests feedback (default: {}). It must not be a command.' '--tx-terminator	The terminator sent after each object (default: newline).'
            set takes --rate=none --count=none --duration=none --mark=none --mark-udp=link --silence=none --limit=none --until=none --exchange=choice:auto,stream,poll,command --poll-json=none --tx-terminator=choice:newline,none,nul,crlf
            set args 'file' 'read:aidin*'
            set lacks --id --baud -n --dry-run -y --yes --history
        case 'aidin export'
            set opts '--to	Output: parquet (columns with types and units, for pandas, needs handctl[parquet]), bids (a BIDS motion dataset), c3d (motion capture, at a constant rate), mcap (messages, for Foxglove and ROS tools, needs handctl[mcap]) or xdf (streams, as LabRecorder writes them).' '--segment	Only segment N.' '--rate	Only for c3d, and mot of an EksoNR: resample to this rate, never across a gap (c3d: default is the rate of the log).' '-h	Show this help.' '--help	Show this help.'
            set takes --to=choice:parquet,bids,c3d,mcap,xdf --segment=none --rate=none
            set args 'file'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'hand'
            set cmds 'status	Show a health summary: the present values, with errors decoded.' 'dump	Read every documented quantity.' 'get	Read quantities by name, such as angle_actual.index temperature.' 'watch	Show values as they change.' 'describe	List every quantity with address, type, range, access and manual section.' 'tactile	Show the tactile sensors of an RH56DFTP. Only reads.' 'stop	Stop the device at once, even while another handctl command is using it.' 'angle	Command angles from 0 (closed) to 1000 (open). Asks first.' 'position	Command strokes from 0 (open) to 2000 (closed). Asks first.' 'speed	Set the speed of all movements from now on, 0 to 1000. Asks first if a finger may move.' 'force	Set the force limit in grams. Asks first if a finger may move.' 'set	Write values by name and read them back. Example: speed_set.index=300 force_limit.index=500.' 'id	Show the id, or give the hand a NEW one (1 to 254).' 'baud	Show the baud rate code, or set a new RATE in bit/s.' 'save	Save the present settings to flash and wait for the result (about 1 s).' 'factory-reset	Restore the factory defaults, after a snapshot of the present settings.' 'network	Show the IP address of a tactile hand, or give it a new ADDRESS.' 'pair	Find out which of two hands is left and which is right, and name both.' 'report	Write one page for a service ticket: status, dump, findings, curves, bytes.' 'doctor	Check this computer, the link and the device.' 'clear-errors	Clear actuator errors and show which remain. Asks first if a finger may move.' 'calibrate	Calibrate the force sensors. The whole hand moves for about 6 s.' 'scan	Detect a device of this family, with its baud rate and id if it has them.' 'listen	Show what the device sends without a request, decoded. Sends nothing.' 'terminal	Send typed lines, and show every byte that comes, in words.' 'read	Read COUNT bytes (1 to 252) from any ADDRESS. Registers from the manual are decoded.' 'write	Write bytes to ADDRESS, low byte first, and read them back. Asks first.' 'raw	Send exactly these EB90 or Modbus bytes and show the decoded reply.' 'snapshot	Save the settings of the device, and the set points that it keeps, to FILE.' 'diff	Compare settings: two snapshots, a snapshot and the device, or two devices.' 'restore	Write the settings that differ from a snapshot, and read them back.' 'log	Record values to FILE (CSV) with a sidecar FILE.json. Ctrl-C ends it.' 'export	Turn a log into a file for pandas, BIDS, motion capture and other tools.'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
        case 'hand status'
            set opts '--check	Exit with code 7 if anything is unhealthy.' '--picture	Draw the device, coloured by temperature, force or error.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --picture=none --limit=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set lacks -n --dry-run -y --yes --history
        case 'hand dump'
            set opts '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --limit=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set lacks -n --dry-run -y --yes --history
        case 'hand get'
            set opts '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --limit=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'read:hand*'
            set lacks -n --dry-run -y --yes --history
        case 'hand watch'
            set opts '--rate	Samples per second (0: as fast as the device replies). Default: 10.' '--count	End after N samples.' '--duration	End after S seconds.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --rate=none --count=none --duration=none --limit=none --until=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'read:hand*'
            set lacks -n --dry-run -y --yes --history
        case 'hand describe'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'name:hand*'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'hand tactile'
            set opts '--watch	Keep reading: a live picture on a terminal, otherwise a stream of rows.' '--rate	Samples per second (0: as fast as the device replies). Default: 5.' '--count	End after N samples.' '--duration	End after S seconds.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --rate=none --count=none --duration=none --limit=none --until=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'none*'
            set lacks -n --dry-run -y --yes --history
        case 'hand stop'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
        case 'hand angle'
            set opts '--wait	Wait up to S seconds for the fingers to stop moving. Ctrl-C sets their speed to 0.' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --wait=none --expect=choice:reached,contact,any --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'none*'
        case 'hand position'
            set opts '--wait	Wait up to S seconds for the fingers to stop moving. Ctrl-C sets their speed to 0.' '--expect	How the movement must end; otherwise the exit code is 7. reached (default): every axis at its target. contact: stopped by an object. any: either of these, or moved and stopped short of the target.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --wait=none --expect=choice:reached,contact,any --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'none*'
        case 'hand speed'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'none*'
        case 'hand force'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'none*'
        case 'hand set'
            set opts '--always	Write settings even if they already have this value.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'set:hand*'
        case 'hand id'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'none'
        case 'hand baud'
            set opts '--save	Then save to flash. The new baud rate takes effect only after a save and a power-cycle.' '--verify	Wait up to 120 s for the power-cycle, then check that the hand replies at the new baud rate.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'none'
        case 'hand save'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
        case 'hand factory-reset'
            set opts '--backup	Write the snapshot to FILE (default: hand-before-reset.json). An existing file is never overwritten.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --backup=file --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
        case 'hand network'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'none'
        case 'hand pair'
            set opts '--first	The side of the first hand. With this option nothing moves.' '--address	New IP address if both hands have the same one (default: the next one).' '--left	Name of the left hand. Default: left.' '--right	Name of the right hand. Default: right.' '--force	Replace devices that already have these names.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --first=choice:left,right --address=none --left=none --right=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'link*'
        case 'hand report'
            set opts '--watch	Record curves for S seconds (0: none). Default: 3.' '--include-ids	Include serial numbers, the wearer\'s number (pilot id), and the replies that contain them.' '--force	Replace FILE.html if it exists.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --watch=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'file'
            set lacks -n --dry-run -y --yes --history
        case 'hand doctor'
            set opts '--count	Read the device N times to measure the error rate. Default: 100.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --count=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set lacks -n --dry-run -y --yes --history
        case 'hand clear-errors'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
        case 'hand calibrate'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
        case 'hand scan'
            set opts '--ids	Ids to try, such as 1-20 or 1,2,4-12. Default: the one given with --id, otherwise all (on CAN 1 to 254), starting with the usual one.' '--all	Keep searching after the first device, without a time limit, and search a silent line again with longer timeouts.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --ids=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set lacks -n --dry-run -y --yes --history
        case 'hand listen'
            set opts '--count	End after N rows.' '--duration	End after S seconds.' '--find-baud	Try the documented baud rates in turn, and stay at the one at which the bytes make sense and no framing errors are counted. On CAN it tries bitrates without acknowledging, until whole frames come.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --count=none --duration=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set lacks -n --dry-run -y --yes --history
        case 'hand terminal'
            set opts '--hex	Take lines as hexadecimal bytes, and show bytes as such.' '--wait	Listen for S seconds after the last byte. Default: 0.5.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --wait=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'none*'
        case 'hand read'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'none' 'none'
            set lacks -n --dry-run -y --yes --history
        case 'hand write'
            set opts '--undocumented	Allow an address that is not in the manual.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'none' 'none'
        case 'hand raw'
            set opts '--wait	Listen for S seconds after the last byte. Default: 0.5.' '--force-ambiguous	Also send a frame that resets the hand, starts a stored movement or has a value out of range.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --wait=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'none*'
        case 'hand snapshot'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'file'
            set lacks -n --dry-run -y --yes --history
        case 'hand diff'
            set opts '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'file' 'file'
            set lacks -n --dry-run -y --yes --history
        case 'hand restore'
            set opts '--skip	Leave out this setting of the snapshot, or one element of it. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --skip=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'file'
        case 'hand log'
            set opts '--rate	Samples per second (0: as fast as the device replies). Default: 0.' '--count	End after N samples.' '--duration	End after S seconds.' '--mark	Mark the first row with TEXT.' '--mark-udp	Each datagram to this UDP port of this computer sets a mark with its text (0: any free port).' '--lsl	Send rows and marks on the Lab Streaming Layer, and record the marks that other programs send there. Needs handctl[lsl].' '--mark-stdin	Each line on standard input sets a mark with its text.' '--silence	End after S seconds without a valid reply. handctl also waits this long for a lost port to come back. Default: 60.' '--force	Overwrite FILE.' '--check	Record nothing: check the recording FILE, and show its segments, its gaps, and how well the device\'s clock and this computer\'s agree. Needs no device. Exit code 7 if it is incomplete or does not match its sidecar.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '--until	End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.' '--serial	With --fake or --dry-run, use a serial line (the default).' '--can	With --fake or --dry-run, use CAN instead of a serial line.' '--modbus-tcp	With --fake or --dry-run, use Modbus TCP instead of a serial line.' '--model	Generation: df, tp, f1 or dg2, or the name on the label, such as RH56DFTP. Without it handctl detects the generation.' '--side	Left or right hand. The hand itself cannot report it.' '--protocol	The protocol on a serial line (default: auto, which tries EB90, then Modbus RTU).'
            set takes --rate=none --count=none --duration=none --mark=none --mark-udp=link --silence=none --limit=none --until=none --model=none --side=choice:left,right --protocol=choice:auto,eb90,modbus
            set args 'file' 'read:hand*'
            set lacks -n --dry-run -y --yes --history
        case 'hand export'
            set opts '--to	Output: parquet (columns with types and units, for pandas, needs handctl[parquet]), bids (a BIDS motion dataset), c3d (motion capture, at a constant rate), mcap (messages, for Foxglove and ROS tools, needs handctl[mcap]) or xdf (streams, as LabRecorder writes them).' '--segment	Only segment N.' '--rate	Only for c3d, and mot of an EksoNR: resample to this rate, never across a gap (c3d: default is the rate of the log).' '-h	Show this help.' '--help	Show this help.'
            set takes --to=choice:parquet,bids,c3d,mcap,xdf --segment=none --rate=none
            set args 'file'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'ports'
            set opts '-h	Show this help.' '--help	Show this help.'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'scan'
            set opts '-p	The link to search (default: all serial ports that are free and accessible). Can be repeated.' '--port	The link to search (default: all serial ports that are free and accessible). Can be repeated.' '--family	Search for this family only. Can be repeated.' '--ids	Ids to try, such as 1-20 or 1,2,4-12. Default: the one given with --id, otherwise all (on CAN 1 to 254), starting with the usual one.' '--all	Keep searching after the first device, without a time limit, and search a silent line again with longer timeouts.' '-h	Show this help.' '--help	Show this help.'
            set takes -p=link --port=link --family=choice:exo,wrist,barrett,ekso,aidin,hand --ids=none
            set lacks -p --port -n --dry-run -y --yes --history --assume-identity
        case 'top'
            set opts '--rate	Samples per second (0: as fast as the device replies). Default: 5.' '--count	End after N samples.' '--duration	End after S seconds.' '--limit	At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.' '-h	Show this help.' '--help	Show this help.'
            set takes --rate=none --count=none --duration=none --limit=none
            set args 'none*'
            set lacks -n --dry-run -y --yes --history --assume-identity
        case 'history'
            set opts '--since	Only from then on: yesterday, today, 2h, 3d, or a date such as 2026-11-25 or 2026-11-25T14:30.' '--last	Only the last N commands.' '-h	Show this help.' '--help	Show this help.'
            set takes --since=none --last=none
            set args 'none'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'prove'
            set opts '--list	List the experiments and send nothing. Needs no device.' '--level	The most that an experiment may do: read, write and put back, move the device, or write what cannot be put back, such as flash. The last kind also has to be named with --only. Default: read.' '--only	Only this fact. Can be repeated.' '--repeat	Repeat each experiment N times. All of them must agree. Default: 3.' '--meter	The reading of a voltmeter at the supply of the device.' '--length-mode	Which bytes the length byte of a request covers: body (default), n-4, n-2 or frame. auto tries each.' '--operator	Your name, for the audit log. Required with --yes.' '--identify	Keep the serial number and other identifying data in the facts file.' '-h	Show this help.' '--help	Show this help.'
            set takes --level=choice:read,write-back,move,permanent --only=none --repeat=none --meter=none --length-mode=none --operator=none
            set args 'choice:exo,wrist,barrett,ekso,aidin,hand,diff' 'file*'
        case 'doctor'
            set opts '--family	The family of the device on the link. Without it, and without -d NAME, handctl detects the device.' '--count	Read the device N times to measure the error rate. Default: 100.' '-h	Show this help.' '--help	Show this help.'
            set takes --family=choice:exo,wrist,barrett,ekso,aidin,hand --count=none
            set lacks -n --dry-run -y --yes --history --assume-identity
        case 'service'
            set opts '--family	The family of the device, so that handctl need not detect it.' '--complaint	What is wrong, in the words of whoever uses the device.' '--ticket	The number of the service ticket.' '--report	The report (default: service-TIME.html in this folder, or the file given with --resume).' '--skip	Skip this step. Can be repeated. On a terminal, press s.' '--resume	Continue an earlier service: steps that its report contains are not repeated.' '--against	Show what differs from an older report.' '--watch	Watch for S seconds. Default: 3.' '--count	Read the device N times to measure the error rate. Default: 100.' '--follow	Carry out the proposed step without asking, if it only reads.' '--include-ids	Include serial numbers, the wearer\'s number (pilot id), and the replies that contain them.' '--force	Replace FILE.html if it exists.' '--demo	Practise finding the fault of a simulated device.' '--finding	Your finding in a demo. Without it, handctl asks.' '--seed	Choose the fault of a demo by this number.' '-h	Show this help.' '--help	Show this help.'
            set takes --family=choice:exo,wrist,barrett,ekso,aidin,hand --complaint=none --ticket=none --report=file --skip=choice:doctor,status,diagnose,watch,dump --resume=file --against=file --watch=none --count=none --demo=choice:any,exo,wrist,barrett,ekso,aidin,hand --finding=none --seed=none
            set args 'link'
            set lacks -n --dry-run -y --yes --history --assume-identity
        case 'stop'
            set opts '-h	Show this help.' '--help	Show this help.'
        case 'shell'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'choice:exo,wrist,barrett,ekso,aidin,hand'
        case 'batch'
            set opts '--keep-going	Continue after a line that failed. The exit code is still that of the first failure.' '-h	Show this help.' '--help	Show this help.'
            set args 'file'
        case 'devices'
            set cmds 'list	List the named devices.' 'add	Give a device a name in the configuration file.' 'remove	Delete a name from the configuration file. The rest of the file is unchanged.' 'show	Show every setting that -d NAME selects, and its source.'
            set opts '-h	Show this help.' '--help	Show this help.'
        case 'devices list'
            set opts '-h	Show this help.' '--help	Show this help.'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'devices add'
            set opts '--from-scan	Take family, link, id and baud rate from the output of handctl scan --json (-: stdin).' '--force	Replace the device that already has this name.' '-h	Show this help.' '--help	Show this help.'
            set takes --from-scan=file
            set args 'none' 'choice:exo,wrist,barrett,ekso,aidin,hand'
        case 'devices remove'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'device'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --assume-identity
        case 'devices show'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'device'
            set lacks -n --dry-run -y --yes --history --assume-identity
        case 'completion'
            set opts '--install	Install it in your own completion directory instead of printing it.' '-h	Show this help.' '--help	Show this help.'
            set args 'choice:bash,zsh,fish,powershell'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --assume-identity
        case 'sim'
            set cmds 'aidin	Serve a simulated AIDIN-hand (TCP, JSON).' 'barrett	Serve a simulated BarrettHand BH8 with RealTime mode and boot monitor.' 'bus	Serve several simulated devices on one RS-485, RS-232 or CAN bus.' 'control	Send a command to a running simulator and print its answer.' 'ekso	Serve a simulated EksoNR exoskeleton with its DataPort (serial).' 'exo	Serve a simulated exoskeleton hand EH55BF1 (serial).' 'forget	Reset the devices that --fake simulates.' 'hand	Serve a simulated RH56 dexterous hand: generations df, tp, f1 and dg2 (serial, CAN, Modbus).' 'wrist	Serve a simulated wrist module with the hand behind it (serial, CAN).'
            set opts '-h	Show this help.' '--help	Show this help.'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity
        case 'sim aidin'
            set opts '--tcp	Serve on a TCP port. Port 0 takes any free port.' '--seed	Seed of the random generator.' '--fault	Faults and states, listed below. Can be repeated.' '--after	Answer the first N requests without the fault.' '--every	Apply the fault only to every N-th request after that.' '--wire	Simulate the transmission time of this baud rate in bit/s (auto: the device\'s baud rate).' '--facts	Become like the device of a facts file (handctl prove -o FILE).' '--state	Keep memory, flash and positions in this file between runs.' '--duration	Stop after S seconds. [0 to 1000000000]' '--control	Open a local socket at PATH for handctl sim control.' '--set	Set one of the options listed below. Can be repeated.' '--transcript	Show the values of the device that was recorded with --trace FILE, as it was left, and reply as quickly.' '-h	Show this help.' '--help	Show this help.'
            set takes --tcp=none --seed=none --fault=choice:healthy,silent,deaf,noise,garble,truncate,dribble,split,bad-checksum,wrong-id,twin-id,echo,loopback,duplicate,stale,late,slow,disconnect,refuse,missing-key,extra-key,wrong-length,nan,wrong-type,not-json,braces,unclosed,degrees,swapped,stuck,frozen,blocked,dead-motor,no-homing,no-bias,weak,held,stall,creep,stiff,one-way,shaky-sensor,numb-sensor,touched --after=none --every=none --wire=none --facts=file --state=file --duration=none --control=file --set=none --transcript=file
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity
        case 'sim barrett'
            set opts '--pty	Serve on a new pseudo terminal.' '--by-id	Make PATH a symbolic link to the pseudo terminal. It stays valid when the port is unplugged and replugged.' '--tcp	Serve on a TCP port. Port 0 takes any free port.' '--seed	Seed of the random generator.' '--fault	Faults and states, listed below. Can be repeated.' '--after	Answer the first N requests without the fault.' '--every	Apply the fault only to every N-th request after that.' '--wire	Simulate the transmission time of this baud rate in bit/s (auto: the device\'s baud rate).' '--facts	Become like the device of a facts file (handctl prove -o FILE).' '--state	Keep memory, flash and positions in this file between runs.' '--duration	Stop after S seconds. [0 to 1000000000]' '--control	Open a local socket at PATH for handctl sim control.' '--set	Set one of the options listed below. Can be repeated.' '--transcript	Show the values of the device that was recorded with --trace FILE, as it was left, and reply as quickly.' '-h	Show this help.' '--help	Show this help.'
            set takes --by-id=file --tcp=none --seed=none --fault=choice:healthy,silent,deaf,noise,garble,truncate,dribble,split,bad-checksum,wrong-id,twin-id,echo,loopback,duplicate,stale,late,slow,disconnect,refuse,no-echo,hang,no-abort,blocked,obstacle,strain,strain-offset,no-gauges,hot,over-temperature,not-homed,no-board,no-motor,reversed,breakaway,eeprom-worn,erratic,unknown-codes,loop-error,loop-silent,loop-drop,loop-extra,blank-firmware,wrong-echo,missing-echo,extra-byte,monitor-hang --after=none --every=none --wire=none --facts=file --state=file --duration=none --control=file --set=none --transcript=file
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity
        case 'sim bus'
            set opts '--pty	Serve on a new pseudo terminal.' '--by-id	Make PATH a symbolic link to the pseudo terminal. It stays valid when the port is unplugged and replugged.' '--tcp	Serve on a TCP port. Port 0 takes any free port.' '--slcan-pty	Serve CAN as an slcan adapter on a new pseudo terminal.' '--slcan-tcp	Serve CAN as an slcan adapter on a TCP port.' '--seed	Seed of the random generator.' '--duration	Stop after S seconds. [0 to 1000000000]' '--control	Open a local socket at PATH for handctl sim control.' '-h	Show this help.' '--help	Show this help.'
            set takes --by-id=file --tcp=none --slcan-tcp=none --seed=none --duration=none --control=file
            set args 'file'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity
        case 'sim control'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'file' 'none*'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity
        case 'sim ekso'
            set opts '--pty	Serve on a new pseudo terminal.' '--by-id	Make PATH a symbolic link to the pseudo terminal. It stays valid when the port is unplugged and replugged.' '--tcp	Serve on a TCP port. Port 0 takes any free port.' '--seed	Seed of the random generator.' '--fault	Faults and states, listed below. Can be repeated.' '--after	Answer the first N requests without the fault.' '--every	Apply the fault only to every N-th request after that.' '--wire	Simulate the transmission time of this baud rate in bit/s (auto: the device\'s baud rate).' '--facts	Become like the device of a facts file (handctl prove -o FILE).' '--state	Keep memory, flash and positions in this file between runs.' '--duration	Stop after S seconds. [0 to 1000000000]' '--control	Open a local socket at PATH for handctl sim control.' '--set	Set one of the options listed below. Can be repeated.' '--transcript	Show the values of the device that was recorded with --trace FILE, as it was left, and reply as quickly.' '-h	Show this help.' '--help	Show this help.'
            set takes --by-id=file --tcp=none --seed=none --fault=choice:healthy,silent,deaf,noise,garble,truncate,dribble,split,bad-checksum,wrong-id,twin-id,echo,loopback,duplicate,stale,late,slow,disconnect,refuse,acknowledge,acknowledge-set,set-unanswered,not-taken,neighbour,pendant,stands-up,fidget,unlisted-codes,unknown-state,stuck-sensor,hip-offset,frozen-clock,clock-jump,reboot,unsolicited,wrong-command,short-body,stray-zero --after=none --every=none --wire=none --facts=file --state=file --duration=none --control=file --set=none --transcript=file
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity
        case 'sim exo'
            set opts '--pty	Serve on a new pseudo terminal.' '--by-id	Make PATH a symbolic link to the pseudo terminal. It stays valid when the port is unplugged and replugged.' '--tcp	Serve on a TCP port. Port 0 takes any free port.' '--seed	Seed of the random generator.' '--fault	Faults and states, listed below. Can be repeated.' '--after	Answer the first N requests without the fault.' '--every	Apply the fault only to every N-th request after that.' '--wire	Simulate the transmission time of this baud rate in bit/s (auto: the device\'s baud rate).' '--facts	Become like the device of a facts file (handctl prove -o FILE).' '--state	Keep memory, flash and positions in this file between runs.' '--duration	Stop after S seconds. [0 to 1000000000]' '--control	Open a local socket at PATH for handctl sim control.' '--set	Set one of the options listed below. Can be repeated.' '--transcript	Show the values of the device that was recorded with --trace FILE, as it was left, and reply as quickly.' '-h	Show this help.' '--help	Show this help.'
            set takes --by-id=file --tcp=none --seed=none --fault=choice:healthy,silent,deaf,noise,garble,truncate,dribble,split,bad-checksum,wrong-id,twin-id,echo,loopback,duplicate,stale,late,slow,disconnect,refuse,strict,block-silent,no-late-frames,save-fails,fresh,foreign,baud-at-1002,faults,hot,blocked,locked-rotor,over-temperature,over-current,motor-abnormal,communication,unknown-bits --after=none --every=none --wire=none --facts=file --state=file --duration=none --control=file --set=none --transcript=file
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity
        case 'sim forget'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'choice:exo,wrist,barrett,ekso,aidin,hand'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity
        case 'sim hand'
            set opts '--pty	Serve on a new pseudo terminal.' '--by-id	Make PATH a symbolic link to the pseudo terminal. It stays valid when the port is unplugged and replugged.' '--tcp	Serve on a TCP port. Port 0 takes any free port.' '--modbus-pty	Serve only Modbus RTU on a new pseudo terminal.' '--modbus-tcp	Serve Modbus TCP to several clients. Can be combined with a serial port of the same device.' '--slcan-pty	Serve CAN as an slcan adapter on a new pseudo terminal.' '--slcan-tcp	Serve CAN as an slcan adapter on a TCP port.' '--model	The model to simulate.' '--seed	Seed of the random generator.' '--fault	Faults and states, listed below. Can be repeated.' '--after	Answer the first N requests without the fault.' '--every	Apply the fault only to every N-th request after that.' '--wire	Simulate the transmission time of this baud rate in bit/s (auto: the device\'s baud rate).' '--facts	Become like the device of a facts file (handctl prove -o FILE).' '--state	Keep memory, flash and positions in this file between runs.' '--duration	Stop after S seconds. [0 to 1000000000]' '--control	Open a local socket at PATH for handctl sim control.' '--set	Set one of the options listed below. Can be repeated.' '--transcript	Show the values of the device that was recorded with --trace FILE, as it was left, and reply as quickly.' '-h	Show this help.' '--help	Show this help.'
            set takes --by-id=file --tcp=none --modbus-tcp=none --slcan-tcp=none --model=choice:df,tp,f1,dg2 --seed=none --fault=choice:healthy,silent,deaf,noise,garble,truncate,dribble,split,bad-checksum,wrong-id,twin-id,echo,loopback,duplicate,stale,late,slow,disconnect,refuse,strict,block-silent,save-fails,fresh,foreign,faults,hot,blocked,locked-rotor,over-temperature,over-current,motor-abnormal,communication,unknown-bits,force-deaf,stops-short,tactile-dead,tactile-saturated,high-half,rtu-unpacked,no-late-frames,no-ack,bus-off,bel,queue,reports,no-status,damaged-lines,no-adapter --after=none --every=none --wire=none --facts=file --state=file --duration=none --control=file --set=none --transcript=file
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity
        case 'sim wrist'
            set opts '--pty	Serve on a new pseudo terminal.' '--by-id	Make PATH a symbolic link to the pseudo terminal. It stays valid when the port is unplugged and replugged.' '--tcp	Serve on a TCP port. Port 0 takes any free port.' '--slcan-pty	Serve CAN as an slcan adapter on a new pseudo terminal.' '--slcan-tcp	Serve CAN as an slcan adapter on a TCP port.' '--seed	Seed of the random generator.' '--fault	Faults and states, listed below. Can be repeated.' '--after	Answer the first N requests without the fault.' '--every	Apply the fault only to every N-th request after that.' '--wire	Simulate the transmission time of this baud rate in bit/s (auto: the device\'s baud rate).' '--facts	Become like the device of a facts file (handctl prove -o FILE).' '--state	Keep memory, flash and positions in this file between runs.' '--duration	Stop after S seconds. [0 to 1000000000]' '--control	Open a local socket at PATH for handctl sim control.' '--set	Set one of the options listed below. Can be repeated.' '--transcript	Show the values of the device that was recorded with --trace FILE, as it was left, and reply as quickly.' '-h	Show this help.' '--help	Show this help.'
            set takes --by-id=file --tcp=none --slcan-tcp=none --seed=none --fault=choice:healthy,silent,deaf,noise,garble,truncate,dribble,split,bad-checksum,wrong-id,twin-id,echo,loopback,duplicate,stale,late,slow,disconnect,refuse,strict,block-silent,no-wrist,save-fails,foreign,faults,hot,blocked,locked-rotor,over-temperature,over-current,motor-abnormal,communication,unknown-bits,no-late-frames,no-ack,bus-off,bel,queue,reports,no-status,damaged-lines,no-adapter --after=none --every=none --wire=none --facts=file --state=file --duration=none --control=file --set=none --transcript=file
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace --format --json --csv -o --output --append --time --no-formulas --wide --long --no-wide --color -q --quiet -v --verbose --debug -n --dry-run -y --yes --history --assume-identity
        case 'plot'
            set opts '--only	Plot only this quantity or element, such as temperature.index. Several: A,B, or repeat it.' '--open	Open the plot in the browser.' '-h	Show this help.' '--help	Show this help.'
            set takes --only=none
            set args 'file*'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'trace'
            set cmds 'diff	Compare the exchanges of two transcripts, A and B.' 'show	Show every frame of FILE (-: stdin) in words, and statistics at the end.' 'decode	Explain frames field by field, for example from a manual or a scope.'
            set opts '-h	Show this help.' '--help	Show this help.'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'trace diff'
            set opts '--family	The family of the device (default: taken from the file, otherwise guessed from the bytes).' '-h	Show this help.' '--help	Show this help.'
            set takes --family=choice:exo,wrist,barrett,ekso,aidin,hand
            set args 'file' 'file'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'trace show'
            set opts '--family	The family of the device (default: taken from the file, otherwise guessed from the bytes).' '--only	Show only bad frames, refusals and requests without a reply.' '--grep	Show only rows whose meaning or bytes match. Case is ignored.' '-h	Show this help.' '--help	Show this help.'
            set takes --family=choice:exo,wrist,barrett,ekso,aidin,hand --only=choice:errors --grep=none
            set args 'file'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'trace decode'
            set opts '--from	The sender of the frames (default: guessed from the bytes).' '-h	Show this help.' '--help	Show this help.'
            set takes --from=choice:host,device
            set args 'choice:exo,wrist,barrett,ekso,aidin,hand' 'none*'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'twin'
            set cmds 'check	Play a recording to the twin of its device, and to the manual\'s simulator.'
            set opts '-h	Show this help.' '--help	Show this help.'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'twin check'
            set opts '--facts	The facts of the twin (handctl prove -o FILE).' '--transcript	The transcript whose final values the twin shows (default: the initial values of TRANSCRIPT itself).' '--against	The simulator, with options that both the simulator and the twin take, such as fake://hand?model=df (default: fake://FAMILY). Nothing but a simulator is accepted.' '--family	The family of the device (default: taken from the file, otherwise guessed from the bytes).' '-h	Show this help.' '--help	Show this help.'
            set takes --facts=file --transcript=file --against=link --family=choice:exo,wrist,barrett,ekso,aidin,hand
            set args 'file'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
        case 'help'
            set opts '-h	Show this help.' '--help	Show this help.'
            set args 'none*'
            set lacks -p --port --fake --facts -d --device --id --baud --timeout --deadline --retries --trace -n --dry-run -y --yes --history --assume-identity
    end
    for option in $lacks
        set shared (string match -v -- $option\t'*' $shared)
    end
    set -a opts $shared
    set -a takes -p=link --port=link --facts=file -d=device --device=device --id=none --baud=none --timeout=none --deadline=none --retries=none --trace=file --format=choice:table,plain,json,ndjson,csv,openmetrics -o=file --output=file --color=choice:auto,always,never --history=choice:devices,all,off
end

function __handctl_map --no-scope-shadowing # FAMILY: names of its quantities; sets readable settable known elements values
    switch "$argv[1]"
        case exo
            set readable 'id	id of the hand on its line' 'baud_code	speed after save and power cycle' 'clear_errors	write 1: clear the clearable actuator errors' 'save	write 1: save the present parameters to flash' 'calibrate	write 1: calibrate forces and positions while someone wears the hand' 'system_voltage	supply voltage as the hand counts it' 'position_set	commanded position, 0 bent to 1000 open, -1 leaves a finger alone' 'force_set	commanded force, positive opens the hand, negative closes it' 'position_actual	measured position, 0 bent to 1000 open, thumb rotation 0 inside the palm' 'force_actual	measured force, positive when the user closes the hand, negative when opening it' 'current	actuator current' 'error	actuator error bits' 'temperature	actuator temperature'
            set settable 'id	id of the hand on its line' 'baud_code	speed after save and power cycle' 'position_set	commanded position, 0 bent to 1000 open, -1 leaves a finger alone' 'force_set	commanded force, positive opens the hand, negative closes it'
            set known 'id	id of the hand on its line' 'baud_code	speed after save and power cycle' 'clear_errors	write 1: clear the clearable actuator errors' 'save	write 1: save the present parameters to flash' 'factory_reset	write 1: restore factory defaults (undocumented address, taken from the RH56 hand)' 'calibrate	write 1: calibrate forces and positions while someone wears the hand' 'system_voltage	supply voltage as the hand counts it' 'position_set	commanded position, 0 bent to 1000 open, -1 leaves a finger alone' 'force_set	commanded force, positive opens the hand, negative closes it' 'position_actual	measured position, 0 bent to 1000 open, thumb rotation 0 inside the palm' 'force_actual	measured force, positive when the user closes the hand, negative when opening it' 'current	actuator current' 'error	actuator error bits' 'temperature	actuator temperature'
            set elements position_set=little,ring,middle,index,thumb force_set=little,ring,middle,index,thumb position_actual=little,ring,middle,index,thumb,thumb_rotation force_actual=little,ring,middle,index,thumb current=little,ring,middle,index,thumb error=little,ring,middle,index,thumb temperature=little,ring,middle,index,thumb
            set values baud_code=0,1,2
        case wrist
            set readable 'pitch_actual	measured pitch' 'yaw_actual	measured yaw' 'current_1024	current of a servo actuator' 'current_1026	current of a servo actuator' 'error_1	error bits of actuator #1' 'error_2	error bits of actuator #2' 'temperature_1	temperature of actuator #1' 'temperature_2	temperature of actuator #2' 'yaw_set	commanded yaw' 'pitch_set	commanded pitch' 'move_time	time of a movement from here to the target'
            set settable 'yaw_set	commanded yaw' 'pitch_set	commanded pitch' 'move_time	time of a movement from here to the target'
            set known 'pitch_actual	measured pitch' 'yaw_actual	measured yaw' 'current_1024	current of a servo actuator' 'current_1026	current of a servo actuator' 'error_1	error bits of actuator #1' 'error_2	error bits of actuator #2' 'temperature_1	temperature of actuator #1' 'temperature_2	temperature of actuator #2' 'yaw_set	commanded yaw' 'pitch_set	commanded pitch' 'move_time	time of a movement from here to the target'
        case barrett
            set readable 'default_position	target of M without an argument, useful to 17,800 (spread 3150)' 'default_step	step of IC and IO without an argument' 'strain_limit_high	a movement ends above this strain (255 and 256 = off)' 'strain_limit_low	a movement ends below this strain (255 and 256 = off)' 'max_open_velocity	opening velocity, below 40 the motor may not move (§8)' 'max_close_velocity	closing velocity, sets the tip force of TC' 'strain_limit_high_alias	the same value as HSG' 'odometer	total distance the motor has moved' 'position	position, about 0 to 17,800 (spread 3150)' 'status	sum of status codes, 0 = ready' 'strain	strain gauge, 100 to 140 without load (§7.4), 255 = no gauge' 'loop_control_velocity	control block has a velocity' 'loop_control_velocity_coefficient	factor of the control velocity, 0 would always stop' 'loop_control_proportional_gain	control block has a gain' 'loop_feedback_velocity	feedback has the velocity' 'loop_feedback_velocity_coefficient	divisor of the velocity in feedback' 'loop_feedback_strain	feedback has the strain' 'loop_feedback_absolute_position	feedback has the position' 'loop_feedback_delta_position	feedback has the change of position' 'loop_feedback_delta_position_coefficient	divisor of the change in feedback' 'acceleration	acceleration, with 0 the motor would never move' 'close_target	target of C' 'enabled	1: also moves without being named; 0: a finger seems dead' 'filter_derivative_zero	filter zero, noisy unless 0' 'filter_integral_pole	filter pole, may be unstable unless 0' 'filter_proportional_gain	filter gain, sets the spread\'s pinch torque' 'hold	servo after a movement, which only heats a finger' 'init_hit_count	hits of the open stop during HI' 'init_offset	distance back from the stop after HI, a larger one lowers the breakaway force' 'init_velocity	velocity of HI' 'max_position_error	how close counts as reached' 'open_target	target of O, also sets the breakaway force' 'sample_time	sample time of the motor controller, not to be changed' 'strain_flip	strain readings are inverted (legacy)' 'stop_time	time a stalled motor is still driven' 'baud_rate	baud rate of the serial line, changes immediately' 'loop_feedback_temperature	feedback has the temperature' 'over_temperature_limit	motor commands fail above it (0 = off, 600 to 650 advised)' 'temperature	temperature of the CPU board, normal 400 to 600, limit 650 (§2)' 'peak_temperature	highest temperature ever' 'uptime_seconds	total operating time' 'serial_number	serial number (0 on upgraded hands)' 'loop_feedback_delta_discard	drop a change that is too large for a byte' 'breakaway_detected	the clutch has broken away' 'breakaway_position	position at breakaway' 'breakaway_stop	stop at breakaway' 'breakaway_acceleration_threshold	detection threshold' 'loop_control_torque	control block has a torque, excludes velocity and gain' 'loop_feedback_breakaway_position	feedback block has the breakaway position' 'loop_feedback_analog_input	feedback block has the analog input' 'firmware	firmware version, as the hand reports it' 'DP' 'DS' 'HSG' 'LSG' 'MOV' 'MCV' 'MSG' 'OD' 'P' 'S' 'SG' 'LCV' 'LCVC' 'LCPG' 'LFV' 'LFVC' 'LFS' 'LFAP' 'LFDP' 'LFDPC' 'ACCEL' 'CT' 'EN' 'FDZ' 'FIP' 'FPG' 'HOLD' 'IHIT' 'IOFF' 'IVEL' 'MPE' 'OT' 'SAMPLE' 'SGFLIP' 'TSTOP' 'BAUD' 'LFT' 'OTEMP' 'TEMP' 'PTEMP' 'UPSECS' 'SN' 'LFDPD' 'BD' 'BP' 'BS' 'BDAT' 'LCT' 'LFBP' 'LFAIN' 'VERS'
            set settable 'default_position	target of M without an argument, useful to 17,800 (spread 3150)' 'default_step	step of IC and IO without an argument' 'strain_limit_high	a movement ends above this strain (255 and 256 = off)' 'strain_limit_low	a movement ends below this strain (255 and 256 = off)' 'max_open_velocity	opening velocity, below 40 the motor may not move (§8)' 'max_close_velocity	closing velocity, sets the tip force of TC' 'strain_limit_high_alias	the same value as HSG' 'loop_control_velocity	control block has a velocity' 'loop_control_velocity_coefficient	factor of the control velocity, 0 would always stop' 'loop_control_proportional_gain	control block has a gain' 'loop_feedback_velocity	feedback has the velocity' 'loop_feedback_velocity_coefficient	divisor of the velocity in feedback' 'loop_feedback_strain	feedback has the strain' 'loop_feedback_absolute_position	feedback has the position' 'loop_feedback_delta_position	feedback has the change of position' 'loop_feedback_delta_position_coefficient	divisor of the change in feedback' 'acceleration	acceleration, with 0 the motor would never move' 'close_target	target of C' 'enabled	1: also moves without being named; 0: a finger seems dead' 'filter_derivative_zero	filter zero, noisy unless 0' 'filter_integral_pole	filter pole, may be unstable unless 0' 'filter_proportional_gain	filter gain, sets the spread\'s pinch torque' 'hold	servo after a movement, which only heats a finger' 'init_hit_count	hits of the open stop during HI' 'init_offset	distance back from the stop after HI, a larger one lowers the breakaway force' 'init_velocity	velocity of HI' 'max_position_error	how close counts as reached' 'open_target	target of O, also sets the breakaway force' 'sample_time	sample time of the motor controller, not to be changed' 'strain_flip	strain readings are inverted (legacy)' 'stop_time	time a stalled motor is still driven' 'baud_rate	baud rate of the serial line, changes immediately' 'loop_feedback_temperature	feedback has the temperature' 'over_temperature_limit	motor commands fail above it (0 = off, 600 to 650 advised)' 'loop_feedback_delta_discard	drop a change that is too large for a byte' 'breakaway_stop	stop at breakaway' 'breakaway_acceleration_threshold	detection threshold' 'loop_control_torque	control block has a torque, excludes velocity and gain' 'loop_feedback_breakaway_position	feedback block has the breakaway position' 'loop_feedback_analog_input	feedback block has the analog input' 'DP' 'DS' 'HSG' 'LSG' 'MOV' 'MCV' 'MSG' 'LCV' 'LCVC' 'LCPG' 'LFV' 'LFVC' 'LFS' 'LFAP' 'LFDP' 'LFDPC' 'ACCEL' 'CT' 'EN' 'FDZ' 'FIP' 'FPG' 'HOLD' 'IHIT' 'IOFF' 'IVEL' 'MPE' 'OT' 'SAMPLE' 'SGFLIP' 'TSTOP' 'BAUD' 'LFT' 'OTEMP' 'LFDPD' 'BS' 'BDAT' 'LCT' 'LFBP' 'LFAIN'
            set known 'default_position	target of M without an argument, useful to 17,800 (spread 3150)' 'default_step	step of IC and IO without an argument' 'strain_limit_high	a movement ends above this strain (255 and 256 = off)' 'strain_limit_low	a movement ends below this strain (255 and 256 = off)' 'max_open_velocity	opening velocity, below 40 the motor may not move (§8)' 'max_close_velocity	closing velocity, sets the tip force of TC' 'strain_limit_high_alias	the same value as HSG' 'odometer	total distance the motor has moved' 'position	position, about 0 to 17,800 (spread 3150)' 'status	sum of status codes, 0 = ready' 'strain	strain gauge, 100 to 140 without load (§7.4), 255 = no gauge' 'loop_control_velocity	control block has a velocity' 'loop_control_velocity_coefficient	factor of the control velocity, 0 would always stop' 'loop_control_proportional_gain	control block has a gain' 'loop_feedback_velocity	feedback has the velocity' 'loop_feedback_velocity_coefficient	divisor of the velocity in feedback' 'loop_feedback_strain	feedback has the strain' 'loop_feedback_absolute_position	feedback has the position' 'loop_feedback_delta_position	feedback has the change of position' 'loop_feedback_delta_position_coefficient	divisor of the change in feedback' 'acceleration	acceleration, with 0 the motor would never move' 'close_target	target of C' 'enabled	1: also moves without being named; 0: a finger seems dead' 'filter_derivative_zero	filter zero, noisy unless 0' 'filter_integral_pole	filter pole, may be unstable unless 0' 'filter_proportional_gain	filter gain, sets the spread\'s pinch torque' 'hold	servo after a movement, which only heats a finger' 'init_hit_count	hits of the open stop during HI' 'init_offset	distance back from the stop after HI, a larger one lowers the breakaway force' 'init_velocity	velocity of HI' 'max_position_error	how close counts as reached' 'open_target	target of O, also sets the breakaway force' 'sample_time	sample time of the motor controller, not to be changed' 'strain_flip	strain readings are inverted (legacy)' 'stop_time	time a stalled motor is still driven' 'baud_rate	baud rate of the serial line, changes immediately' 'loop_feedback_temperature	feedback has the temperature' 'over_temperature_limit	motor commands fail above it (0 = off, 600 to 650 advised)' 'temperature	temperature of the CPU board, normal 400 to 600, limit 650 (§2)' 'peak_temperature	highest temperature ever' 'uptime_seconds	total operating time' 'serial_number	serial number (0 on upgraded hands)' 'loop_feedback_delta_discard	drop a change that is too large for a byte' 'breakaway_detected	the clutch has broken away' 'breakaway_position	position at breakaway' 'breakaway_stop	stop at breakaway' 'breakaway_acceleration_threshold	detection threshold' 'loop_control_torque	control block has a torque, excludes velocity and gain' 'loop_feedback_breakaway_position	feedback block has the breakaway position' 'loop_feedback_analog_input	feedback block has the analog input' 'firmware	firmware version, as the hand reports it' 'DP' 'DS' 'HSG' 'LSG' 'MOV' 'MCV' 'MSG' 'OD' 'P' 'S' 'SG' 'LCV' 'LCVC' 'LCPG' 'LFV' 'LFVC' 'LFS' 'LFAP' 'LFDP' 'LFDPC' 'ACCEL' 'CT' 'EN' 'FDZ' 'FIP' 'FPG' 'HOLD' 'IHIT' 'IOFF' 'IVEL' 'MPE' 'OT' 'SAMPLE' 'SGFLIP' 'TSTOP' 'BAUD' 'LFT' 'OTEMP' 'TEMP' 'PTEMP' 'UPSECS' 'SN' 'LFDPD' 'BD' 'BP' 'BS' 'BDAT' 'LCT' 'LFBP' 'LFAIN' 'VERS'
            set elements default_position=F1,F2,F3,SPREAD DP=F1,F2,F3,SPREAD default_step=F1,F2,F3,SPREAD DS=F1,F2,F3,SPREAD strain_limit_high=F1,F2,F3,SPREAD HSG=F1,F2,F3,SPREAD strain_limit_low=F1,F2,F3,SPREAD LSG=F1,F2,F3,SPREAD max_open_velocity=F1,F2,F3,SPREAD MOV=F1,F2,F3,SPREAD max_close_velocity=F1,F2,F3,SPREAD MCV=F1,F2,F3,SPREAD strain_limit_high_alias=F1,F2,F3,SPREAD MSG=F1,F2,F3,SPREAD odometer=F1,F2,F3,SPREAD OD=F1,F2,F3,SPREAD position=F1,F2,F3,SPREAD P=F1,F2,F3,SPREAD status=F1,F2,F3,SPREAD S=F1,F2,F3,SPREAD strain=F1,F2,F3,SPREAD SG=F1,F2,F3,SPREAD loop_control_velocity=F1,F2,F3,SPREAD LCV=F1,F2,F3,SPREAD loop_control_velocity_coefficient=F1,F2,F3,SPREAD LCVC=F1,F2,F3,SPREAD loop_control_proportional_gain=F1,F2,F3,SPREAD LCPG=F1,F2,F3,SPREAD loop_feedback_velocity=F1,F2,F3,SPREAD LFV=F1,F2,F3,SPREAD loop_feedback_velocity_coefficient=F1,F2,F3,SPREAD LFVC=F1,F2,F3,SPREAD loop_feedback_strain=F1,F2,F3,SPREAD LFS=F1,F2,F3,SPREAD loop_feedback_absolute_position=F1,F2,F3,SPREAD LFAP=F1,F2,F3,SPREAD loop_feedback_delta_position=F1,F2,F3,SPREAD LFDP=F1,F2,F3,SPREAD loop_feedback_delta_position_coefficient=F1,F2,F3,SPREAD LFDPC=F1,F2,F3,SPREAD acceleration=F1,F2,F3,SPREAD ACCEL=F1,F2,F3,SPREAD close_target=F1,F2,F3,SPREAD CT=F1,F2,F3,SPREAD enabled=F1,F2,F3,SPREAD EN=F1,F2,F3,SPREAD filter_derivative_zero=F1,F2,F3,SPREAD FDZ=F1,F2,F3,SPREAD filter_integral_pole=F1,F2,F3,SPREAD FIP=F1,F2,F3,SPREAD filter_proportional_gain=F1,F2,F3,SPREAD FPG=F1,F2,F3,SPREAD hold=F1,F2,F3,SPREAD HOLD=F1,F2,F3,SPREAD init_hit_count=F1,F2,F3,SPREAD IHIT=F1,F2,F3,SPREAD init_offset=F1,F2,F3,SPREAD IOFF=F1,F2,F3,SPREAD init_velocity=F1,F2,F3,SPREAD IVEL=F1,F2,F3,SPREAD max_position_error=F1,F2,F3,SPREAD MPE=F1,F2,F3,SPREAD open_target=F1,F2,F3,SPREAD OT=F1,F2,F3,SPREAD sample_time=F1,F2,F3,SPREAD SAMPLE=F1,F2,F3,SPREAD strain_flip=F1,F2,F3,SPREAD SGFLIP=F1,F2,F3,SPREAD stop_time=F1,F2,F3,SPREAD TSTOP=F1,F2,F3,SPREAD breakaway_detected=F1,F2,F3,SPREAD BD=F1,F2,F3,SPREAD breakaway_position=F1,F2,F3,SPREAD BP=F1,F2,F3,SPREAD breakaway_stop=F1,F2,F3,SPREAD BS=F1,F2,F3,SPREAD breakaway_acceleration_threshold=F1,F2,F3,SPREAD BDAT=F1,F2,F3,SPREAD loop_control_torque=F1,F2,F3,SPREAD LCT=F1,F2,F3,SPREAD loop_feedback_breakaway_position=F1,F2,F3,SPREAD LFBP=F1,F2,F3,SPREAD loop_feedback_analog_input=F1,F2,F3,SPREAD LFAIN=F1,F2,F3,SPREAD
            set values loop_control_velocity=0,1 LCV=0,1 loop_control_proportional_gain=0,1 LCPG=0,1 loop_feedback_velocity=0,1 LFV=0,1 loop_feedback_strain=0,1 LFS=0,1 loop_feedback_absolute_position=0,1 LFAP=0,1 loop_feedback_delta_position=0,1 LFDP=0,1 enabled=0,1 EN=0,1 hold=0,1 HOLD=0,1 strain_flip=0,1 SGFLIP=0,1 baud_rate=6,12,24,48,96,192,384 BAUD=6,12,24,48,96,192,384 loop_feedback_temperature=0,1 LFT=0,1 loop_feedback_delta_discard=0,1 LFDPD=0,1 loop_control_torque=0,1 LCT=0,1 loop_feedback_breakaway_position=0,1 LFBP=0,1 loop_feedback_analog_input=0,1 LFAIN=0,1
        case ekso
            set readable 'upper_leg_length	length of the thigh' 'lower_leg_length	length of the shank' 'step_length	length of a step' 'step_height	height of a step' 'swing_time	duration of the swing' 'stand_time	duration of the stance' 'knee_flexion	flexion of the knee' 'hip_flexion	flexion of the hip' 'forward_shift	weight shift forward, unit unknown' 'lateral_shift	weight shift to the side, unit unknown' 'walk_mode	how steps are started' 'stand_mode	how standing up is led' 'target_sounds	which targets sound' 'injury_mode	affected side' 'left_swing_assist	help in the left swing' 'right_swing_assist	help in the right swing' 'left_stance_support	support of the left stance' 'right_stance_support	support of the right stance' 'swing_complete	when a swing is complete, unit unknown' 'pilot_id	number of the pilot, personal' 'sit_mode	how sitting down is led' 'lean_allowance	how far leaning is allowed' 'torso_pitch	trunk, leaning forward is positive' 'torso_roll	trunk to the side, sign unknown' 'right_toe_pressure	sole sensor, unit unknown' 'right_heel_pressure	sole sensor, unit unknown' 'left_toe_pressure	sole sensor, unit unknown' 'left_heel_pressure	sole sensor, unit unknown' 'right_hip_x	hip before the foot' 'right_hip_y	hip above the sole' 'left_hip_x	hip before the foot' 'left_hip_y	hip above the sole' 'right_hip_current	motor current' 'right_hip_angle	flexion is positive' 'right_knee_current	motor current' 'right_knee_angle	flexion is positive' 'left_hip_current	motor current' 'left_hip_angle	flexion is positive' 'left_knee_current	motor current' 'left_knee_angle	flexion is positive' 'state	high digit posture, bit 0x0400 joints driven, other bits unknown' 'foot_state	one byte a foot, meaning unknown' 'min_state	meaning unknown' 'lcd_button_state	meaning unknown' 'weight_shift	weight shift' 'hmi_data	meaning unknown' 'va_ref_time	unit unknown' 'boot_time_high	milliseconds since power-on, high word' 'boot_time_low	milliseconds since power-on, low word' 'steps_taken	steps, wraps at 65536' 'upright_time	time upright, wraps at 65536' 'walk_time	time walking, wraps at 65536' 'left_max_forward_assist	unit unknown' 'left_assist_gain	unit unknown' 'right_max_forward_assist	unit unknown' 'right_assist_gain	unit unknown' 'left_hip_stance_support	unit unknown' 'left_knee_stance_support	unit unknown' 'right_hip_stance_support	unit unknown' 'right_knee_stance_support	unit unknown' 'left_step_length	as reported' 'right_step_length	as reported' 'left_swing_time	as reported' 'right_swing_time	as reported' 'date	the device\'s date' 'time	the device\'s time'
            set settable 'upper_leg_length	length of the thigh' 'lower_leg_length	length of the shank' 'step_length	length of a step' 'step_height	height of a step' 'swing_time	duration of the swing' 'stand_time	duration of the stance' 'knee_flexion	flexion of the knee' 'hip_flexion	flexion of the hip' 'forward_shift	weight shift forward, unit unknown' 'lateral_shift	weight shift to the side, unit unknown' 'walk_mode	how steps are started' 'stand_mode	how standing up is led' 'target_sounds	which targets sound' 'injury_mode	affected side' 'left_swing_assist	help in the left swing' 'right_swing_assist	help in the right swing' 'left_stance_support	support of the left stance' 'right_stance_support	support of the right stance' 'sit_mode	how sitting down is led' 'lean_allowance	how far leaning is allowed'
            set known 'upper_leg_length	length of the thigh' 'lower_leg_length	length of the shank' 'step_length	length of a step' 'step_height	height of a step' 'swing_time	duration of the swing' 'stand_time	duration of the stance' 'knee_flexion	flexion of the knee' 'hip_flexion	flexion of the hip' 'forward_shift	weight shift forward, unit unknown' 'lateral_shift	weight shift to the side, unit unknown' 'walk_mode	how steps are started' 'stand_mode	how standing up is led' 'target_sounds	which targets sound' 'injury_mode	affected side' 'left_swing_assist	help in the left swing' 'right_swing_assist	help in the right swing' 'left_stance_support	support of the left stance' 'right_stance_support	support of the right stance' 'swing_complete	when a swing is complete, unit unknown' 'pilot_id	number of the pilot, personal' 'sit_mode	how sitting down is led' 'lean_allowance	how far leaning is allowed' 'torso_pitch	trunk, leaning forward is positive' 'torso_roll	trunk to the side, sign unknown' 'right_toe_pressure	sole sensor, unit unknown' 'right_heel_pressure	sole sensor, unit unknown' 'left_toe_pressure	sole sensor, unit unknown' 'left_heel_pressure	sole sensor, unit unknown' 'right_hip_x	hip before the foot' 'right_hip_y	hip above the sole' 'left_hip_x	hip before the foot' 'left_hip_y	hip above the sole' 'right_hip_current	motor current' 'right_hip_angle	flexion is positive' 'right_knee_current	motor current' 'right_knee_angle	flexion is positive' 'left_hip_current	motor current' 'left_hip_angle	flexion is positive' 'left_knee_current	motor current' 'left_knee_angle	flexion is positive' 'state	high digit posture, bit 0x0400 joints driven, other bits unknown' 'foot_state	one byte a foot, meaning unknown' 'min_state	meaning unknown' 'lcd_button_state	meaning unknown' 'weight_shift	weight shift' 'hmi_data	meaning unknown' 'va_ref_time	unit unknown' 'boot_time_high	milliseconds since power-on, high word' 'boot_time_low	milliseconds since power-on, low word' 'steps_taken	steps, wraps at 65536' 'upright_time	time upright, wraps at 65536' 'walk_time	time walking, wraps at 65536' 'left_max_forward_assist	unit unknown' 'left_assist_gain	unit unknown' 'right_max_forward_assist	unit unknown' 'right_assist_gain	unit unknown' 'left_hip_stance_support	unit unknown' 'left_knee_stance_support	unit unknown' 'right_hip_stance_support	unit unknown' 'right_knee_stance_support	unit unknown' 'left_step_length	as reported' 'right_step_length	as reported' 'left_swing_time	as reported' 'right_swing_time	as reported' 'date	the device\'s date' 'time	the device\'s time'
            set values walk_mode=0,1,2,3 stand_mode=0,1 target_sounds=0,1,2,3 injury_mode=0,1,2,3 left_swing_assist=0,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17,18,19,20,21,22,23,24,25,26,27 right_swing_assist=0,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17,18,19,20,21,22,23,24,25,26,27 left_stance_support=0,1,2,3,4,5 right_stance_support=0,1,2,3,4,5 sit_mode=0,1 lean_allowance=0,1,2
        case aidin
            set readable 'motor_pos	motor encoders, 0 where homing left them' 'joint_pos	joint angles' 'task_space_pos	fingertip coordinates' 'current_state	motor currents' 'sensor_state	fingertip forces and torques'
            set known 'motor_pos	motor encoders, 0 where homing left them' 'joint_pos	joint angles' 'task_space_pos	fingertip coordinates' 'current_state	motor currents' 'sensor_state	fingertip forces and torques' 'hand_mode	operating mode' 'maxtorque	maximum current, 700 to 1000 recommended' 'hand_tp_cmd	encoder targets' 'hand_joint_cmd	joint angle targets' 'hand_taskspace_cmd	fingertip targets' 'hand_tt_cmd	motor current targets'
            set elements motor_pos=thumb.m1,thumb.m2,thumb.m3,index.m1,index.m2,index.m3,middle.m1,middle.m2,middle.m3,ring.m1,ring.m2,ring.m3,little.m1,little.m2,little.m3 joint_pos=thumb.q1,thumb.q2,thumb.q3,thumb.q4,index.q1,index.q2,index.q3,index.q4,middle.q1,middle.q2,middle.q3,middle.q4,ring.q1,ring.q2,ring.q3,ring.q4,little.q1,little.q2,little.q3,little.q4 task_space_pos=thumb.x,thumb.y,thumb.z,index.x,index.y,index.z,middle.x,middle.y,middle.z,ring.x,ring.y,ring.z,little.x,little.y,little.z current_state=thumb.m1,thumb.m2,thumb.m3,index.m1,index.m2,index.m3,middle.m1,middle.m2,middle.m3,ring.m1,ring.m2,ring.m3,little.m1,little.m2,little.m3 sensor_state=thumb.fx,thumb.fy,thumb.fz,thumb.tx,thumb.ty,thumb.tz,index.fx,index.fy,index.fz,index.tx,index.ty,index.tz,middle.fx,middle.fy,middle.fz,middle.tx,middle.ty,middle.tz,ring.fx,ring.fy,ring.fz,ring.tx,ring.ty,ring.tz,little.fx,little.fy,little.fz,little.tx,little.ty,little.tz hand_tp_cmd=thumb.m1,thumb.m2,thumb.m3,index.m1,index.m2,index.m3,middle.m1,middle.m2,middle.m3,ring.m1,ring.m2,ring.m3,little.m1,little.m2,little.m3 hand_joint_cmd=thumb.q1,thumb.q2,thumb.q3,thumb.q4,index.q1,index.q2,index.q3,index.q4,middle.q1,middle.q2,middle.q3,middle.q4,ring.q1,ring.q2,ring.q3,ring.q4,little.q1,little.q2,little.q3,little.q4 hand_taskspace_cmd=thumb.x,thumb.y,thumb.z,index.x,index.y,index.z,middle.x,middle.y,middle.z,ring.x,ring.y,ring.z,little.x,little.y,little.z hand_tt_cmd=thumb.m1,thumb.m2,thumb.m3,index.m1,index.m2,index.m3,middle.m1,middle.m2,middle.m3,ring.m1,ring.m2,ring.m3,little.m1,little.m2,little.m3
        case hand
            set readable 'id	id of the hand on its line, unit on Modbus' 'baud_code	speed after save and power cycle' 'current_limit	current at which an actuator protects itself' 'default_speed	speed after power-up' 'default_force	force threshold after power-up' 'system_voltage	supply voltage as the hand counts it' 'stroke_set	commanded stroke, 0 open to 2000 closed, -1 leaves a finger as it is' 'angle_set	commanded angle, 0 closed to 1000 open, -1 leaves a finger as it is' 'force_limit	threshold in grams at which a closing finger stops, no force that it holds' 'speed_set	speed of the next movement, 0 stops' 'stroke_actual	measured stroke, 0 open to 2000 closed' 'angle_actual	measured angle, 0 closed to 1000 open' 'force_actual	measured force, negative values at rest are normal' 'current	actuator current' 'error	error bits' 'status	what the finger does' 'temperature	actuator temperature' 'ip_address	address of the hand on its network, after save and power cycle'
            set settable 'current_limit	current at which an actuator protects itself' 'default_speed	speed after power-up' 'default_force	force threshold after power-up' 'stroke_set	commanded stroke, 0 open to 2000 closed, -1 leaves a finger as it is' 'angle_set	commanded angle, 0 closed to 1000 open, -1 leaves a finger as it is' 'force_limit	threshold in grams at which a closing finger stops, no force that it holds' 'speed_set	speed of the next movement, 0 stops'
            set known 'id	id of the hand on its line, unit on Modbus' 'baud_code	speed after save and power cycle' 'clear_errors	write 1: clear all errors but over-temperature' 'save	write 1: save the present parameters to flash' 'factory_reset	write 1: restore the factory defaults' 'calibrate_force	write 1: calibrate the force sensors, the hand moves' 'current_limit	current at which an actuator protects itself' 'default_speed	speed after power-up' 'default_force	force threshold after power-up' 'system_voltage	supply voltage as the hand counts it' 'stroke_set	commanded stroke, 0 open to 2000 closed, -1 leaves a finger as it is' 'angle_set	commanded angle, 0 closed to 1000 open, -1 leaves a finger as it is' 'force_limit	threshold in grams at which a closing finger stops, no force that it holds' 'speed_set	speed of the next movement, 0 stops' 'stroke_actual	measured stroke, 0 open to 2000 closed' 'angle_actual	measured angle, 0 closed to 1000 open' 'force_actual	measured force, negative values at rest are normal' 'current	actuator current' 'error	error bits' 'status	what the finger does' 'temperature	actuator temperature' 'ip_address	address of the hand on its network, after save and power cycle'
            set elements current_limit=little,ring,middle,index,thumb_bend,thumb_rotation default_speed=little,ring,middle,index,thumb_bend,thumb_rotation default_force=little,ring,middle,index,thumb_bend,thumb_rotation stroke_set=little,ring,middle,index,thumb_bend,thumb_rotation angle_set=little,ring,middle,index,thumb_bend,thumb_rotation force_limit=little,ring,middle,index,thumb_bend,thumb_rotation speed_set=little,ring,middle,index,thumb_bend,thumb_rotation stroke_actual=little,ring,middle,index,thumb_bend,thumb_rotation angle_actual=little,ring,middle,index,thumb_bend,thumb_rotation force_actual=little,ring,middle,index,thumb_bend,thumb_rotation current=little,ring,middle,index,thumb_bend,thumb_rotation error=little,ring,middle,index,thumb_bend,thumb_rotation status=little,ring,middle,index,thumb_bend,thumb_rotation temperature=little,ring,middle,index,thumb_bend,thumb_rotation ip_address=a,b,c,d
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
    printf '%s\n' tcp:// usb: can:socketcan: can:slcan: can:pcan: socket:// replay: fake://exo fake://wrist fake://barrett fake://ekso fake://aidin fake://hand
    set -l ports /dev/serial/by-id/* /dev/ttyUSB* /dev/ttyACM* /dev/rfcomm* /dev/cu.usb*
    set -l interfaces /sys/class/net/can* /sys/class/net/vcan* /sys/class/net/slcan*
    set -l slcan /dev/ttyACM* /dev/ttyUSB*
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
