"""handctl on Windows, seen from Linux: a Windows Python under wine beside this one, each command line on both."""
