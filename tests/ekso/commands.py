"""Every `handctl ekso` command once: what it asks and writes, what it shows of the simulated unit, what it leaves there.

Values are the power-on values of the simulated unit, typed by hand: raw words in wire order, scales as the manual's
command table has them. Nothing is computed by handctl.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handctl.command import snapshots
from tests.support.inputs import made_once

ME = ("--yes", "--operator", "me")
TIME, DATE, SETTINGS, DATA, FEEDBACK, SET, CANCEL = range(150, 157)

# name, raw word at power-on (signed as it is meant), scale
SETTING_WORDS: tuple[tuple[str, int, int], ...] = (
    ("upper_leg_length", 1680, 100), ("lower_leg_length", 1640, 100), ("step_length", 1475, 100),
    ("step_height", 175, 100), ("swing_time", 110, 100), ("stand_time", 65, 100), ("knee_flexion", 1250, 100),
    ("hip_flexion", 820, 100), ("forward_shift", -150, 100), ("lateral_shift", 85, 100), ("walk_mode", 3, 1),
    ("stand_mode", 1, 1), ("target_sounds", 0, 1), ("injury_mode", 2, 1), ("left_swing_assist", 8, 1),
    ("right_swing_assist", 14, 1), ("left_stance_support", 4, 1), ("right_stance_support", 5, 1),
    ("swing_complete", 6, 1), ("pilot_id", 4711, 1), ("sit_mode", 0, 1), ("lean_allowance", 2, 1),
)  # fmt: skip
# standing upright without sway: hips by the leg equations (dossier 10) from pitch 6, hips -1.0 and -0.1, knees 0.2, 1.4
DATA_WORDS: tuple[tuple[str, int, int], ...] = (
    ("torso_pitch", 600, 100), ("torso_roll", 80, 100), ("right_toe_pressure", 260, 1), ("right_heel_pressure", 710, 1),
    ("left_toe_pressure", 130, 1), ("left_heel_pressure", 390, 1), ("right_hip_x", 69, 10), ("right_hip_y", 3695, 100),
    ("left_hip_x", 67, 10), ("left_hip_y", 3696, 100), ("right_hip_current", 145, 100), ("right_hip_angle", -100, 100),
    ("right_knee_current", -38, 100), ("right_knee_angle", 20, 100), ("left_hip_current", 235, 100),
    ("left_hip_angle", -10, 100), ("left_knee_current", -72, 100), ("left_knee_angle", 140, 100), ("state", 0x2040, 1),
    ("foot_state", 0x0404, 1), ("min_state", 0, 1), ("lcd_button_state", 0x4100, 1), ("weight_shift", 1000, 1000),
    ("hmi_data", 1, 1), ("va_ref_time", 12, 10),
)  # fmt: skip
FEEDBACK_WORDS: tuple[tuple[str, int, int], ...] = (
    ("steps_taken", 214, 1), ("upright_time", 1530, 1), ("walk_time", 417, 1), ("left_max_forward_assist", 385, 10),
    ("left_assist_gain", 270, 10), ("right_max_forward_assist", 405, 10), ("right_assist_gain", 295, 10),
    ("left_hip_stance_support", 550, 10), ("left_knee_stance_support", 640, 10), ("right_hip_stance_support", 575, 10),
    ("right_knee_stance_support", 665, 10), ("left_step_length", 142, 10), ("right_step_length", 147, 10),
    ("left_swing_time", 11, 10), ("right_swing_time", 13, 10),
)  # fmt: skip
BOOT = ("boot_time_high", "boot_time_low")
SCALES = {name: scale for name, _, scale in (*SETTING_WORDS, *DATA_WORDS, *FEEDBACK_WORDS)}
POWER_ON = {name: raw for name, raw, _ in (*SETTING_WORDS, *DATA_WORDS, *FEEDBACK_WORDS)}
PLACES = {name: place for place, (name, _, _) in enumerate(SETTING_WORDS)}
MESSAGES = {
    "settings": tuple(PLACES),
    "data": (*(name for name, _, _ in DATA_WORDS), *BOOT),
    "feedback": (*(name for name, _, _ in FEEDBACK_WORDS), *BOOT),
}
ALL = (*MESSAGES["settings"], *MESSAGES["data"], *MESSAGES["feedback"])


@dataclass(frozen=True)
class Command:
    """One command line.

    kind      read, stream, log, cancel, set (one or more settings), none (the device is not asked)
    args      {dir} is a scratch directory of the test
    writes    (ParameterID, raw value, name) of the SetValue messages it sends, in order
    shows     the names of its rows when it succeeds, in order
    asks      message codes that it sends on a healthy line, in order
    posture   in which the wearer is
    """

    name: str
    kind: str
    args: tuple[str, ...]
    shows: tuple[str, ...] = ()
    asks: tuple[int, ...] = ()
    writes: tuple[tuple[int, int, str], ...] = ()
    posture: str = "standing"

    def words(self, scratch: Path) -> list[str]:
        """The words after `handctl ekso`, with scratch files in place."""
        return [word.replace("{dir}", str(scratch)) for word in self.args]

    @property
    def frames(self) -> list[bytes]:
        """Bodies of its SetValue messages."""
        return [number.to_bytes(2, "big") + (raw % 65536).to_bytes(2, "big") for number, raw, _ in self.writes]


WRITING = (DATA, DATA, SETTINGS, DATA, DATA, SET, SETTINGS)
"""The look at the settings that are shown, stillness; then for each setting: settings again, stillness, the one write,
the read-back."""
ONE = (SETTINGS, *WRITING)
CLOCK = (DATE, TIME, DATE)
STATUS = (*MESSAGES["data"][:25], *MESSAGES["feedback"][:3], *PLACES, "boot_ms", "date", "time", "clock_offset")


def setting(name: str, text: str, *writes: tuple[int, int, str], **more: str) -> Command:
    """A `set` of one quantity."""
    return Command(name, "set", ("set", text, *ME), tuple(key for _, _, key in writes), ONE, writes, **more)


READING = (
    Command("status", "read", ("status",), STATUS, (DATA, DATA, SETTINGS, FEEDBACK, *CLOCK)),
    Command("status-check", "read", ("status", "--check"), STATUS, (DATA, DATA, SETTINGS, FEEDBACK, *CLOCK)),
    Command("dump", "read", ("dump",), ("date", "time", *ALL), (SETTINGS, DATA, FEEDBACK, *CLOCK)),
    Command("settings", "read", ("settings",), MESSAGES["settings"], (SETTINGS,)),
    Command("data", "read", ("data",), MESSAGES["data"], (DATA,)),
    Command("feedback", "read", ("feedback",), MESSAGES["feedback"], (FEEDBACK,)),
    Command("time", "read", ("time",), ("time",), (TIME,)),
    Command("date", "read", ("date",), ("date",), (DATE,)),
    Command("get", "read", ("get", "Step Length", "216", "left_knee_angle"),
            ("step_length", "left_swing_assist", "left_knee_angle"), (SETTINGS, DATA)),
    Command("watch", "stream", ("watch", "step_height", "--count", "3", "--rate", "20"),
            ("step_height",) * 3, (SETTINGS,) * 3),
    Command("watch-data", "stream", ("watch", "right_hip_y", "--count", "2", "--rate", "0"),
            ("right_hip_y",) * 2, (DATA,) * 2),
    Command("log", "log", ("log", "{dir}/new.csv", "--count", "3", "--rate", "20", "--silence", "2"), (),
            (SETTINGS, *CLOCK, DATA, FEEDBACK, DATA, DATA, SETTINGS, FEEDBACK)),
    Command("snapshot", "read", ("snapshot", "{dir}/new.json"), tuple(
        name for name in PLACES if name not in ("swing_complete", "pilot_id")), (SETTINGS,)),
    Command("diff", "read", ("diff", "{dir}/power-on.json"), (), (SETTINGS,)),
)  # fmt: skip
WRITES = (
    setting("set", "step_length=15.5", (202, 1550, "step_length")),
    setting("set-negative", "forward_shift=-1.25", (208, -125, "forward_shift")),
    setting("set-label", "lean_allowance=Max", (214, 1, "lean_allowance")),
    setting("set-percent", "left_swing_assist=50 %", (216, 10, "left_swing_assist")),
    setting("set-twice", "219=Very High", (219, 3, "right_stance_support")),
    setting("set-sitting", "upper_leg_length=17.0", (200, 1700, "upper_leg_length"), posture="sitting"),
    Command("restore", "set", ("restore", "{dir}/other.json", *ME), ("swing_time", "left_stance_support"),
            (*ONE, *WRITING[2:]), ((204, 120, "swing_time"), (217, 2, "left_stance_support"))),
    Command("cancel", "cancel", ("cancel",), ("cancel_action",), (TIME, CANCEL)),
)  # fmt: skip
OFFLINE = (
    Command("describe", "none", ("describe", "step_length"), ("step_length",)),
    Command("dry-run", "none", ("set", "step_length=15.5", "-n")),
    Command("dry-cancel", "none", ("cancel", "-n")),
    Command("dry-restore", "none", ("restore", "{dir}/other.json", "-n")),
    Command("too-far", "none", ("set", "swing_complete=1", *ME)),
)
COMMANDS = (*READING, *WRITES, *OFFLINE)


@made_once
def prepare(path: Path) -> None:
    """The input files of the commands."""
    kept = {name: raw / scale for name, raw, scale in SETTING_WORDS if name not in ("swing_complete", "pilot_id")}
    for name, values in (("power-on", kept), ("other", {**kept, "swing_time": 1.2, "left_stance_support": 2})):
        snapshots.write(str(path / f"{name}.json"), snapshots.make("ekso", {}, values, link="test", fake=True))


def unit(**options: object) -> str:
    """A simulated unit on virtual time whose wearer keeps still; names may use _ for -."""
    made = {"clock": "virtual", "sway": 0, **options}
    return "fake://ekso?" + "&".join(f"{key.replace('_', '-')}={value}" for key, value in made.items())
