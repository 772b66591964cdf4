"""Makes a virtual environment that holds the ROS 2 wheels an underlay that colcon builds on.

The wheels unpack to a complete ament prefix, except that they name paths of the machine that built them and bring no
set-up script. Run by the environment's own Python after each pip install; running it again changes nothing.
"""

import re
import sys
import sysconfig
from pathlib import Path

EXPORTS = "share/*/cmake/export_*__rosidl_generator_pyExport.cmake"
PYTHON_HEADERS = re.compile(r'[^";]*/include/python3\.\d+(?=[";])')
NUMPY_HEADERS = re.compile(r'[^";]*/numpy/_core/include(?=[";])')

LOCAL_SETUP = """\
# Puts this environment on the paths of ROS 2; the set-up scripts of a workspace built on it source this file.
_aerial_prepend() {{
  eval "_aerial_old=\\"\\${{$1:-}}\\""
  case ":$_aerial_old:" in
    *":$2:"*) ;;
    *) export "$1=$2${{_aerial_old:+:$_aerial_old}}" ;;
  esac
  unset _aerial_old
}}
{prepends}
unset -f _aerial_prepend
export ROS_VERSION=2 ROS_DISTRO=jazzy ROS_PYTHON_VERSION=3 RMW_IMPLEMENTATION=rmw_fastrtps_cpp
# The wheels' start-up hook would otherwise run every Python twice to set LD_LIBRARY_PATH.
export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
"""


def mend_header_paths(prefix: Path, python_headers: str, numpy_headers: str) -> None:
    """Points the CMake targets of the message packages to the headers of this Python and its numpy."""
    for export in prefix.glob(EXPORTS):
        as_built = export.read_text()
        mended = PYTHON_HEADERS.sub(lambda _: python_headers, as_built)
        mended = NUMPY_HEADERS.sub(lambda _: numpy_headers, mended)
        if mended != as_built:
            export.write_text(mended)


def write_local_setup(prefix: Path) -> None:
    """Writes ``local_setup.sh`` and ``local_setup.bash``, which colcon chains to the workspaces built on `prefix`."""
    # auditwheel put the libraries that the wheels depend on into folders beside their packages.
    libraries = [prefix / "lib", *sorted(prefix.glob("lib/python3.*/site-packages/ros_*.libs"))]
    paths = [("PATH", prefix / "bin"), ("AMENT_PREFIX_PATH", prefix), ("CMAKE_PREFIX_PATH", prefix)]
    paths += [("LD_LIBRARY_PATH", folder) for folder in reversed(libraries)]
    prepends = "\n".join(f'_aerial_prepend {name} "{folder}"' for name, folder in paths)
    for shell in ("sh", "bash"):
        (prefix / f"local_setup.{shell}").write_text(LOCAL_SETUP.format(prepends=prepends))


def hide_from_colcon(prefix: Path) -> None:
    """Keeps colcon from taking the installed packages for sources."""
    (prefix / "COLCON_IGNORE").touch()


def main() -> None:
    import numpy

    prefix = Path(sys.prefix)
    mend_header_paths(prefix, sysconfig.get_paths()["include"], numpy.get_include())
    write_local_setup(prefix)
    hide_from_colcon(prefix)


if __name__ == "__main__":
    main()
