import importlib.util
import os
import shutil
import subprocess
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]

# Stands in for every Python that ./aerial calls; notes the calls.
PYTHON = """\
#!/bin/sh
echo "$*" >>"$NOTES"
case "$*" in
  "-m venv "*)
    [ -z "$NO_SPACE" ] || { echo "no space left on device"; exit 1; }
    mkdir -p "$3/bin" && cp "$0" "$3/bin/python" && cp "$(dirname "$0")/colcon" "$3/bin/" ;;
  */mend_wheels.py)
    echo "PATH=$VIRTUAL_ENV/bin:\\$PATH" >"$VIRTUAL_ENV/local_setup.bash" ;;
  "-P -m aerial_operator"*)
    echo "python path: $PYTHONPATH, ament path: $AMENT_PREFIX_PATH, threads: $OMP_NUM_THREADS" ;;
esac
"""
COLCON = """\
#!/bin/sh
echo "colcon $*" >>"$NOTES"
executables=install/aerial_sim/lib/aerial_sim
mkdir -p $executables
echo "# built on $VIRTUAL_ENV" | tee install/setup.sh >install/setup.bash
printf '#!/bin/sh\\necho "sim_node $*"\\n' >$executables/sim_node
chmod +x $executables/sim_node
"""


class Checkout:
    """A copy of what set-up reads, where Python and colcon only note that they were called."""

    def __init__(self, folder: Path) -> None:
        self.top = folder / "checkout"
        self.tools = folder / "tools"
        self.notes = folder / "notes"
        for path in ["aerial", "requirements.txt", "ros_ws/mend_wheels.py", "ros_ws/colcon_defaults.yaml"]:
            (self.top / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(TOP / path, self.top / path)
        self.manifest = self.top / "src/aerial_sim/package.xml"
        self.manifest.parent.mkdir(parents=True)
        self.manifest.write_text("<package/>")
        model = self.top / "src/aerial_model/aerial_model/__init__.py"
        model.parent.mkdir(parents=True)
        model.write_text('__version__ = "0.0.7"  # made up\n')
        self.tools.mkdir()
        for name, text in {"python3": PYTHON, "colcon": COLCON}.items():
            (self.tools / name).write_text(text)
            (self.tools / name).chmod(0o755)

    def call(self, *arguments: str, command: Path | None = None, **environment: str) -> subprocess.CompletedProcess:
        """Run ./aerial from another folder."""
        environment = {"NOTES": str(self.notes), "AERIAL_PYTHON": str(self.tools / "python3")} | environment
        return subprocess.run(
            [command or self.top / "aerial", *arguments],
            env=os.environ | environment,
            cwd=self.tools,
            capture_output=True,
            text=True,
            timeout=60,
        )

    def steps(self) -> list[str]:
        """Which steps of set-up were made since the last time this was asked."""
        marks = {"-m venv": "venv", "-m pip install": "pip", "mend_wheels": "mend", "colcon build": "build"}
        notes = self.notes.read_text() if self.notes.exists() else ""
        self.notes.unlink(missing_ok=True)
        return [step for line in notes.splitlines() for mark, step in marks.items() if mark in line]


@pytest.fixture
def checkout(tmp_path):
    return Checkout(tmp_path)


@pytest.fixture(scope="session")
def mend_wheels():
    spec = importlib.util.spec_from_file_location("mend_wheels", TOP / "ros_ws/mend_wheels.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
