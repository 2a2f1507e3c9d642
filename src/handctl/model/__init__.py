"""The device model: parameters, results, movements, stops, recorded bytes and the record of writes. Knows no family."""
