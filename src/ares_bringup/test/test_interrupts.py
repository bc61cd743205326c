# SPDX-License-Identifier: Apache-2.0
"""Signals that end a command at any time, without output of Python's own."""

import signal
import subprocess
import sys

import pytest

from ares_trials.testing.samples import one_in

BOTH = [signal.SIGINT, signal.SIGTERM]
#: What either does in the same way: `make trials` sends both.
EITHER = one_in(2, BOTH)

#: A kernel that goes on for minutes, in the main thread or in one of a pool that is waited for.
IN_A_KERNEL = """
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Thread

import numpy as np

from ares_bringup.commands.interrupts import Interrupts
from ares_models.jit import kernel


@kernel
def turn(stop):
    x = 1.0
    while stop[0] == 0:
        for _ in range(1000):
            x = 1.0 - 0.5 * x
        stop[1] += 1
    return x


def say_when_it_turns():
    # nothing tells that compiled code has been entered; a second is ample
    time.sleep(1.0)
    print("ready", flush=True)


stop = np.zeros(2, np.int64)
stop[0] = 1
turn(stop)
stop[0] = 0
with Interrupts() as interrupts:
    try:
        if sys.argv[1] == "main":
            Thread(target=say_when_it_turns, daemon=True).start()
            turn(stop)
        pool = ThreadPoolExecutor(1)
        pool.submit(turn, stop)
        print("ready", flush=True)
        while True:
            stop[1] += 0
    except KeyboardInterrupt:
        print("in order", flush=True)
sys.exit(interrupts.status(0))
"""

#: A command that ends by itself, with what it has to say.
IN_PYTHON = """
import sys
import time

from ares_bringup.commands.interrupts import Interrupts

with Interrupts() as interrupts:
    try:
        print("ready", flush=True)
        time.sleep(600.0)
    except KeyboardInterrupt:
        print("in order", flush=True)
sys.exit(interrupts.status(0))
"""

IN_COMPILED_CODE = """
import sys
import time

from ares_bringup.commands.interrupts import Interrupts

with Interrupts() as interrupts:
    try:
        print("ready", flush=True)
        time.sleep(600.0)
    except KeyboardInterrupt as error:
        raise TypeError("Unable to convert function return value") from error
sys.exit(interrupts.status(0))
"""

#: As in the callback of a binding that prints what it raises, by PyErr_Print, and goes on.
IN_A_CALLBACK = IN_PYTHON.replace(
    'print("in order"', 'sys.excepthook(*sys.exc_info())\n        print("in order"'
)

#: As where a dataclass is made.
IN_AN_EXECUTED_TEXT = """
import sys
import time

from ares_bringup.commands.interrupts import Interrupts

with Interrupts() as interrupts:
    try:
        print("ready", flush=True)
        exec("time.sleep(600.0)")
    except KeyboardInterrupt:
        print("in order", flush=True)
sys.exit(interrupts.status(0))
"""

#: As in a callback of compiled code.
WHERE_NOTHING_CAN_BE_RAISED = """
import sys
import time

from ares_bringup.commands.interrupts import Interrupts


class Lasting:
    def __del__(self):
        print("ready", flush=True)
        time.sleep(600.0)


with Interrupts() as interrupts:
    Lasting()
    time.sleep(600.0)
"""

#: At the edge of a verb.
AROUND_A_VERB = """
import sys
import time

from ares_bringup.commands import cli

cli._run = lambda _argv: print("ready", flush=True) or time.sleep(600.0)
sys.exit(cli.main())
"""

#: A command whose interpreter takes long to end.
AT_THE_VERY_END = """
import atexit
import sys
import time

from ares_bringup.commands.interrupts import end_at_once, leave_the_end_alone


class Lasting:
    def __del__(self):
        print("ready", flush=True)
        time.sleep(0.5)


end_at_once()
leave_the_end_alone()
lasting = Lasting()
sys.exit(1)
"""

AT_ONCE = """
import time

from ares_bringup.commands.interrupts import end_at_once

end_at_once()
print("ready", flush=True)
time.sleep(600.0)
"""


#: In front of scripts that end by themselves: however busy the machine is, they have the time to.
IN_GOOD_ORDER = """
from ares_bringup.commands import interrupts

interrupts.GRACE = 60.0
"""


def interrupted(tmp_path, text, number, *arguments):
    """Run a script, send it a signal once it is ready; return exit status, output and errors."""
    script = tmp_path / "script.py"
    script.write_text(text)
    process = subprocess.Popen(
        [sys.executable, "-m", "script", *arguments],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    process.send_signal(number)
    out, err = process.communicate(timeout=120)
    return process.returncode, out, err


@pytest.mark.trial
@pytest.mark.parametrize("number", EITHER)
def test_in_a_kernel(tmp_path, number):
    status, out, err = interrupted(tmp_path, IN_A_KERNEL, number, "main")
    assert (status, out, err) == (128 + number, "", "ares: interrupted; nothing was written\n")


@pytest.mark.trial
@pytest.mark.parametrize("number", EITHER)
def test_while_threads_are_in_kernels(tmp_path, number):
    """End although the interpreter would wait for its threads forever."""
    status, out, err = interrupted(tmp_path, IN_A_KERNEL, number, "thread")
    assert (status, out, err) == (128 + number, "in order\n", "")


@pytest.mark.parametrize("number", BOTH)
def test_in_python(tmp_path, number):
    status, out, err = interrupted(tmp_path, IN_GOOD_ORDER + IN_PYTHON, number)
    assert (status, out, err) == (128 + number, "in order\n", "")


@pytest.mark.parametrize("number", BOTH)
def test_in_a_text_that_is_executed(tmp_path, number):
    """Return the status although Python, run as a module, would end itself by SIGINT."""
    status, out, err = interrupted(tmp_path, IN_GOOD_ORDER + IN_AN_EXECUTED_TEXT, number)
    assert (status, out, err) == (128 + number, "in order\n", "")


@pytest.mark.parametrize("number", EITHER)
def test_where_nothing_can_be_raised(tmp_path, number):
    status, out, err = interrupted(tmp_path, WHERE_NOTHING_CAN_BE_RAISED, number)
    assert (status, out, err) == (128 + number, "", "ares: interrupted; nothing was written\n")


@pytest.mark.parametrize("number", EITHER)
def test_in_a_callback_of_compiled_code(tmp_path, number):
    status, out, err = interrupted(tmp_path, IN_GOOD_ORDER + IN_A_CALLBACK, number)
    assert (status, out, err) == (128 + number, "in order\n", "")


@pytest.mark.parametrize("number", EITHER)
def test_before_a_verb_begins_or_after_it(tmp_path, number):
    text = IN_GOOD_ORDER + AROUND_A_VERB
    said = "ares: interrupted; nothing was written\n"
    assert interrupted(tmp_path, text, number) == (128 + number, "", said)


#: In a verb that has written a file, or none yet.
IN_A_VERB = """
import sys
import time
from pathlib import Path

from ares_bringup.commands import cli
from ares_bringup.whole_file import write_whole


@cli.app.command()
def write(names: list[str]) -> None:
    for name in filter(None, names):
        write_whole(Path(name), b"whole")
    print("ready", flush=True)
    time.sleep(600.0)


cli.answer = lambda *_: None
sys.exit(cli.main(["write", *sys.argv[1:]]))
"""


@pytest.mark.parametrize("number", EITHER)
@pytest.mark.parametrize(
    ("files", "kept"), [(("",), "nothing was written"), (("a", "b"), "written: a, b")]
)
def test_a_verb_says_what_is_kept(tmp_path, number, files, kept):
    text = IN_GOOD_ORDER + IN_A_VERB
    status, out, err = interrupted(tmp_path, text, number, *files)
    assert (status, out, err) == (128 + number, "", f"ares: interrupted; {kept}\n")
    assert [name for name in files if not (tmp_path / name).exists()] == []


def test_a_flight_that_had_not_begun_prints_no_summary(monkeypatch, capsys):
    from ares_bringup import fly
    from ares_bringup.commands.cli import main
    from ares_bringup.summary import FlightSummary

    def fly_nothing(options, tell, **_):
        facts = fly.mission_facts(options.mission)
        summary = FlightSummary(facts, options.guidance, None, interrupted=True)
        tell(summary)
        return summary

    monkeypatch.setattr(fly, "fly", fly_nothing)
    assert main(["fly", "--no-record"]) == 130
    said = "ares: interrupted before the flight began; nothing was written\n"
    assert capsys.readouterr() == ("", said)


@pytest.mark.parametrize("number", EITHER)
def test_when_the_interpreter_ends(tmp_path, number):
    """Send the signal after the command has ended: its status stands."""
    assert interrupted(tmp_path, AT_THE_VERY_END, number) == (1, "", "")


@pytest.mark.parametrize("number", EITHER)
def test_what_compiled_code_makes_of_it(tmp_path, number):
    """Let a binding replace the KeyboardInterrupt by an error of its own."""
    text = IN_GOOD_ORDER + IN_COMPILED_CODE
    assert interrupted(tmp_path, text, number) == (128 + number, "", "")


@pytest.mark.parametrize("number", BOTH)
def test_before_the_command_line_is_there(tmp_path, number):
    said = "ares: interrupted; nothing was written\n"
    assert interrupted(tmp_path, AT_ONCE, number) == (128 + number, "", said)


@pytest.mark.parametrize("number", BOTH)
def test_a_verb_that_becomes_a_node_holds_signals_back_until_it_is_one(tmp_path, number):
    """Send the signal before the node's Python has started."""
    script = tmp_path / "script.py"
    script.write_text(
        "import os, signal, sys, threading\n"
        "from ares_bringup.commands.cli import main\n"
        "become = os.execv\n"
        "def execv(*words):\n"
        f"    signal.pthread_kill(threading.get_ident(), {number})\n"
        "    become(*words)\n"
        "os.execv = execv\n"
        "sys.exit(main(['node', 'sim']))\n"
    )
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
