"""The hostile suite: every command against devices, files, settings and places that mean no good. README of the tests tells more."""
