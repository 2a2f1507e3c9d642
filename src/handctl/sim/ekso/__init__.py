"""The simulated EksoNR."""
