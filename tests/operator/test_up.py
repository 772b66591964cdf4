"""`aerial up` and `aerial select` as a person uses them, in lock-step so that a busy machine can follow."""

import json
import signal
import subprocess
import sys
import threading

import pytest

PATIENCE = 120.0  # [s]


@pytest.fixture(scope="module")
def up():
    """Nodes that are ready for selections, started by the command."""
    command = [sys.executable, "-m", "aerial_operator", "up", "--lock-step", "--noise", "off", "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    ready = threading.Event()
    said = []

    def listen():
        for line in process.stderr:
            said.append(line)
            if "ready. In another terminal: ./aerial select" in line:
                ready.set()

    listener = threading.Thread(target=listen)
    listener.start()
    try:
        assert ready.wait(PATIENCE), said
        yield process
    finally:
        process.terminate()
        process.wait(PATIENCE)
        listener.join()


def test_select_waits_until_the_robot_has_landed(up, aerial_process):
    ended = aerial_process("select", "jump", "--to", "0.2,0,0", "--json")
    assert ended.status == 0
    assert ended.figures["outcome"] == "landed"
    assert [answer["outcome"] for answer in ended.figures["answers"]] == ["planned", "started", "landed"]
    assert "landed after" in ended.errors


def test_select_lets_the_controller_act_alone(up, aerial_process):
    assert aerial_process("select", "lie_down").status == 0
    assert aerial_process("select", "stand_up").status == 0


def test_a_refused_selection_ends_with_status_1_and_the_reason(up, aerial_process):
    ended = aerial_process("select", "jmup", "--json")
    assert ended.status == 1
    assert ended.figures["refusal"]["code"] == "unknown_motion"
    assert "did you mean 'jump'" in ended.errors


def test_up_ends_its_nodes_when_told_to(up):
    up.send_signal(signal.SIGTERM)
    figures = json.loads(up.stdout.read())
    assert up.wait(PATIENCE) == 0
    assert figures == {"success": True, "ready": True, "died": []}
