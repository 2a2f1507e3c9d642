"""Man pages, shell completions and the tables of README and guides, from the command tree and the parameter maps.

`python -m handctl.docgen` writes them into `man/`, `completions/`, README and guides; `handctl completion` prints the one of a shell.
`tree` reads the click commands into plain data, `man` and `completion` write text from that. Only `tree` knows click; nothing
here talks to a device.
"""
