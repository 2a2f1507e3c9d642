"""The generations of RH56 hands: their names, the labels that name them, and the limits that differ (rh56 §1, §3.1). Data; sans I/O."""

from __future__ import annotations

DF, TP, F1, DG2 = "df", "tp", "f1", "dg2"
MODELS = {
    DF: "RH56DFX, DFQ or BFX (DF)",
    TP: "RH56DFTP or RH56E2 (TP)",
    F1: "RH56F1 (F1)",
    DG2: "RH5DG2 (DG2)",
}
"""Generation -> what is sold as it (rh56 §1)."""
LABELS = {
    "rh56dfx": DF, "rh56dfq": DF, "rh56bfx": DF, "rh56dftp": TP, "rh56e2": TP, "rh56e2-t1": TP, "rh56f1": F1, "rh56f1-e2": F1,
    "rh56f1-e4": F1, "rh56h1": F1, "rh5dg2": DG2,
}  # fmt: skip
"""The name on a label, in small letters -> generation (rh56 §1)."""

FORCE_MOST = {DF: 1000, TP: 3000}
"""Grams of a force threshold (rh56 §3.1)."""
THUMB_DEFAULT = 1500
"""Grams of the default of DF's thumb pair (rh56 §3.1)."""


def model_of(text: str) -> str | None:
    """``tp``, ``RH56DFTP`` -> generation; None where the label is not known (rh56 §1)."""
    word = text.strip().casefold()
    return word if word in MODELS else LABELS.get(word)
