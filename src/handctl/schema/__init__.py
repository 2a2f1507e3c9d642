"""JSON Schemas of what handctl writes; `envelope-1.json` describes `--json` and the closing line of a stream, `facts-1.json` the file of `prove`."""
