"""``aerial campaign``: its contract on the command line; a failed trial can be run again alone."""

import json
import shlex

import pytest

TRIALS = 2
LOW_FRICTION = 0.02  # on which no robot jumps forward


@pytest.fixture(scope="module")
def slippery(aerial_process, tmp_path_factory):
    """Jumps on ordinary ground and on ground that is too slippery."""
    folder = tmp_path_factory.mktemp("campaign")
    vary = f"friction={LOW_FRICTION}:0.7:2"
    options = ("--trials", TRIALS, "--seed", 4, "--vary", vary, "--workers", 1, "--out", folder)
    return aerial_process("campaign", "jump", "--to", "0.3,0,0", *options, "--json"), folder


def test_a_campaign_counts_what_lands_in_each_world(slippery):
    ended, _ = slippery
    assert ended.status == 0
    figures = ended.figures
    rows = [(row["friction"], row["trials"], row["landed"]) for row in figures["conditions"]]
    assert rows == [(LOW_FRICTION, TRIALS, 0), (0.7, TRIALS, TRIALS)]
    assert (figures["trials"], figures["landed"], figures["success_rate"]) == (2 * TRIALS, TRIALS, 0.5)
    assert figures["interval95"][0] < 0.5 < figures["interval95"][1]


def test_a_campaign_leaves_results_and_a_figure(slippery):
    ended, folder = slippery
    results = [json.loads(line) for line in (folder / "trials.jsonl").read_text().splitlines()]
    assert {result["seed"] for result in results} == {4, 5}
    assert (folder / "campaign.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((folder / "campaign.json").read_text()) == ended.figures


def test_a_campaign_keeps_every_key(slippery, missing_keys):
    ended, folder = slippery
    landed = json.loads((folder / "trials.jsonl").read_text().splitlines()[-1])
    assert missing_keys("campaign", ended.figures) == []
    assert missing_keys("trial", landed) == []


def test_a_failed_trial_fails_again_when_it_is_run_alone(slippery, aerial_process, tmp_path):
    ended, _ = slippery
    failure = ended.figures["failures"][0]
    program, *words, _ = shlex.split(failure["command"])
    assert program == "./aerial"
    alone = aerial_process(*words, tmp_path / "trial.png", "--json")
    assert alone.status == 1
    assert ", ".join(name for name, holds in alone.figures["checks"].items() if not holds) == failure["reason"]
    assert (tmp_path / "trial.png").exists()


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["--trials", "0"], 1, "at least 1 trial, found 0"),
        (["--workers", "0"], 2, "expected at least 1, found 0"),
        (["--vary", "frictoin=0:1"], 2, "did you mean 'friction'"),
        (["--vary", "friction=0.4"], 2, "expected KEY=LO:HI"),
        (["--vary", "friction=1:0.4"], 2, "LO not above HI"),
        (["--world", "colour=1"], 2, "no condition 'colour'"),
        (["--world", "mass=-1"], 2, "mass must be positive"),
        (["--world", "mass"], 2, "expected KEY=VALUE"),
        (["--library", "plans"], 2, "would not be repeatable alone"),
    ],
)
def test_bad_input_is_one_sentence(aerial, arguments, status, words):
    ended = aerial("campaign", "jump", *arguments)
    assert ended.status == status
    assert words in ended.errors
    assert "Traceback" not in ended.errors
