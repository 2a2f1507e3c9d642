"""The simulated BarrettHand."""
