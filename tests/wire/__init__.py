"""The golden wire: for every command what it sends, shows and returns, hashed cell by cell into one file, `golden.txt`.

    seams.py    where a run is watched, interrupted or robbed of its process: all that this folder knows of src's inside
    cells.py    which cells there are, each a line of text that names a command, its wire and what is done to it
    record.py   one cell run in process and on virtual time, and the parts of what it left behind
    book.py     golden.txt: read, written, replayed in two processes, compared
    __main__.py `python -m tests.wire`

A refactoring that keeps behaviour keeps every line. A change of behaviour is a diff of golden.txt.
"""
