"""The BarrettHand BH8 series: supervisory mode (GCL) over RS-232."""
