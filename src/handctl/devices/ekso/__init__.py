"""The DataPort of the EksoNR over serial: live data, settings with their policy and audit, logs."""
