"""The life of a command: from the command line to its envelope."""
