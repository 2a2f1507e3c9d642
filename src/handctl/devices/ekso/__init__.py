"""EksoNR DataPort."""
