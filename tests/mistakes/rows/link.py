"""Links: locks, CAN, TCP, transcripts, the child that stops for a command that died."""

from tests.mistakes.table import mistake

LOCK = "handctl.link.lock"

ROWS = (
    mistake(
        "lock-of-a-symbolic-link",
        "two locks",
        "handctl.system.ports",
        "place",
        'return f"tty {os.major(found.st_rdev)}:{os.minor(found.st_rdev)}"',
        "return path",
        "tests/link/test_lock.py::test_one_device_has_one_lock_by_whatever_name",
    ),
    mistake(
        "lock-of-an-adapter-for-can",
        "two locks",
        LOCK,
        "canonical",
        'return canonical(channel) if interface == "slcan" else f"can {interface}:{channel}"',
        'return f"can {interface}:{channel}"',
        "tests/link/test_lock.py::test_one_device_has_one_lock_by_whatever_name",
    ),
    mistake(
        "lock-of-a-host-in-capitals",
        "two locks",
        LOCK,
        "canonical",
        'host, colon, port = rest.partition("?")[0].rstrip("/").casefold().rpartition(":")',
        'host, colon, port = rest.partition("?")[0].rstrip("/").rpartition(":")',
        "tests/link/test_places.py::test_other_machines_are_other_places",
        "tests/link/test_lock.py::test_one_device_has_one_lock_by_whatever_name",
    ),
    mistake(
        "lock-follows-a-symbolic-link",
        "symbolic link followed",
        LOCK,
        "_open",
        "path, os.O_RDWR | os.O_CREAT | disk.NO_LINK | disk.CLOSED_IN_CHILDREN | disk.BINARY, 0o600",
        "path, os.O_RDWR | os.O_CREAT | disk.CLOSED_IN_CHILDREN | disk.BINARY, 0o600",
        "tests/link/test_lock.py::test_a_symbolic_link_in_the_place_of_the_file_is_not_followed",
    ),
    mistake(
        "lock-names-another-program-of-that-number",
        "evidence believed",
        LOCK,
        "_holder",
        'return holder if holder.start in ("", processes.began(holder.pid)) else None',
        "return holder",
        "tests/link/test_lock.py::test_who_holds_it_is_named_when_it_is_known",
    ),
)
