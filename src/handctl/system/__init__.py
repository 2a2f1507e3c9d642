"""Differences between Linux, macOS and Windows, one subject per module. No other module checks which system it is.

    clock      the monotonic clock, and sleep
    signals    what asks the program to end, alarms, what runs in the main thread at once
    locks      one process at a time
    ports      names of serial ports, who has one, why it cannot be opened
    terminal   single keys, lines at a prompt, pseudo terminals
    folders    configuration, state, and what lasts until log-out
    disk       files that are on the disk, flags of opening
    local      how a process is reached by another one of this machine
    processes  whether one lives, since when, and how it is ended
    child      the process that outlives this one
    waits      waiting for a descriptor, a socket or a pipe; how stdout writes

Knows nothing of handctl. Where a system lacks something, a function says so by what it returns; branches on `sys.platform`
are such that the type checker follows them for each system (`mypy --platform win32`).
"""
