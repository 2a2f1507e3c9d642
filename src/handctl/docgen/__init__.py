"""Man pages, shell completions and the tables of README and guides, from the command tree and the parameter maps.

`python -m handctl.docgen` writes them into `man/`, `completions/`, README and guides; `handctl completion` prints the one of a shell.
`read_command_tree` reads the click commands into plain data, `man_pages` and `completion_scripts` write text from that. Only `read_command_tree` knows click; nothing
here talks to a device.
"""
