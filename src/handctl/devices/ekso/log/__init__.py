"""Logs of GetData: recording, reading back, export."""
