"""The RH56 hands: DF and TP (byte addresses), F1 and DG2 (word addresses)."""
