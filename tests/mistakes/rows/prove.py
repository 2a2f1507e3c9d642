"""Proofs and facts: a verdict from a damaged reply, what is not put back, facts that reach the wrong device or name theirs."""

from tests.mistakes.table import mistake

PROOFS = "handctl.model.proofs"
OF_INSPIRE = "handctl.devices.inspire.proofs"
OF_BARRETT = "handctl.devices.barrett.proofs"
FACTS = "handctl.model.facts"
CHANGE = "tests/tools/test_prove.py::test_a_change_of_the_simulator_is_found"
ODD = "tests/pins/test_faults.py::test_pins"
BACK = "tests/tools/test_prove.py::test_what_was_written_is_put_back"

ROWS = (
    mistake(
        "a-proof-believes-a-disturbed-line",
        "evidence believed",
        PROOFS,
        "_attempt",
        "if _damage(counters, proof) != before or not alike(proof, first.value, second.value):",
        "if not alike(proof, first.value, second.value):",
        f"{ODD}[prove-odd-exo]",
    ),
    mistake(
        "a-proof-believes-gcl-with-damage-in-it",
        "evidence believed",
        OF_BARRETT,
        "_clean",
        "if not answer.raw.isascii():",
        "if not answer.raw:",
        f"{ODD}[prove-odd-barrett]",
    ),
    mistake(
        "a-proof-takes-one-silence-for-a-fact",
        "evidence believed",
        OF_INSPIRE,
        "reply",
        "if how != SILENT:",
        "if how:",
        f"{ODD}[prove-odd-hand]",
    ),
    mistake(
        "a-proof-believes-repetitions-that-disagree",
        "evidence believed",
        PROOFS,
        "carry_out",
        "if not all(alike(proof, found[0].value, seen.value) for seen in found):",
        "if not found:",
        "tests/kernel/test_proofs.py::test_repetitions_that_disagree_show_nothing",
    ),
    mistake(
        "a-proof-does-not-give-the-id-back",
        "not put back",
        OF_INSPIRE,
        "_back_home",
        "if probe(bus, back.id) or not probe(bus, bus.id):",
        "if not probe(bus, back.id) and not probe(bus, bus.id):",
        BACK,
    ),
    mistake(
        "a-proof-does-not-read-the-id-back",
        "not put back",
        OF_INSPIRE,
        "_back_home",
        "if not probe(bus, bus.id) or bus.read(register.address, 1) != old:",
        "if bus.over:",
        "tests/tools/test_prove.py::test_a_hand_that_falls_silent_meanwhile_gives_no_fact",
    ),
    mistake(
        "ctrl-c-ends-the-way-back",
        "not put back",
        PROOFS,
        "put_back",
        "except KeyboardInterrupt:\n    do()\n    raise",
        "except KeyboardInterrupt:\n    raise",
        "tests/tools/test_prove.py::test_ctrl_c_in_the_middle_puts_it_back",
    ),
    mistake(
        "a-proof-leaves-the-higher-speed",
        "not put back",
        OF_BARRETT,
        "_put_back",
        "if hand.line.link.baud != speed:",
        "if hand.line.link.baud == speed:",
        CHANGE,
    ),
    mistake(
        "a-movement-is-not-asked-for",
        "moves unasked",
        "handctl.tools.prove",
        "cli",
        'questions = ". ".join(dict.fromkeys(proof.question for proof in proofs if proof.question))',
        'questions = ""',
        "tests/tools/test_prove.py::test_what_moves_asks_and_ends_at_what_the_hand_refuses",
    ),
    mistake(
        "a-proof-goes-on-after-a-refused-movement",
        "swallowed error",
        OF_BARRETT,
        "_at_stop",
        "if table.failure is not None:\n    raise table.failure",
        "hand.line.found()",
        "tests/tools/test_prove.py::test_what_moves_asks_and_ends_at_what_the_hand_refuses",
    ),
    mistake(
        "facts-of-another-family-are-used",
        "another device",
        "handctl.command.precedence",
        "_take_facts",
        'if family is not None and family.kind != content["family"]:',
        "if family is not None and family.kind is None:",
        "tests/tools/test_prove.py::test_an_option_wins_over_a_fact_and_another_family_is_refused",
    ),
    mistake(
        "the-facts-file-names-the-link",
        "private data",
        PROOFS,
        "Outcome.fact",
        'more = {"evidence": self.evidence} if shown else {"why": self.why}',
        'more = {"evidence": self.evidence} if shown else {"why": self.evidence}',
        "tests/tools/test_prove.py::test_the_facts_file_has_its_schema_and_names_no_device",
    ),
    mistake(
        "a-fact-that-was-not-shown-sets-a-switch",
        "evidence believed",
        FACTS,
        "shown",
        'return {name: fact["value"] for name, fact in content["facts"].items() if fact["verdict"] in SHOWN}',
        'return {name: fact["assumed"] for name, fact in content["facts"].items()}',
        "tests/tools/test_prove.py::test_diff_compares_two_devices",
    ),
)
