"""What a device is, to the kernel: its quantities, its results, its recorded bytes, its ledger of writes."""
