"""Every message of handctl, written down to be read as a diff; the tests assert codes, exit codes and values.

sources.py   what the source can say: each text and hint with what is put into it, by code
cells.py     how it reads when it is said: what the cells of the golden wire say, numbers and bytes taken out
sources.txt, cells.txt   both, written down
__main__.py  `python -m tests.messages`
"""
