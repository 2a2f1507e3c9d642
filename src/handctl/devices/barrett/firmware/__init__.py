"""Loading firmware through the boot monitor (barrett §3.7)."""
