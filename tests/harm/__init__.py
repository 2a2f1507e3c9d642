"""The harm matrix: every command of every family against every device in every state. README of the tests tells more."""
