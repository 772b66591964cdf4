"""The mends of the ROS 2 wheels, on a made-up environment folder."""

import subprocess

import pytest

PYTHON_HEADERS = "/usr/include/python3.11"
NUMPY_HEADERS = "/here/site-packages/numpy/_core/include"
EXPORT = """\
set_target_properties(std_msgs::std_msgs__rosidl_generator_py PROPERTIES
  INTERFACE_INCLUDE_DIRECTORIES "{0}"
  INTERFACE_LINK_LIBRARIES "std_msgs::std_msgs__rosidl_generator_c"
)
"""
AS_BUILT = EXPORT.format("/opt/cp311/include/python3.11;/opt/cp311/lib/python3.11/site-packages/numpy/_core/include")


@pytest.fixture
def prefix(tmp_path):
    (tmp_path / "lib/python3.11/site-packages/ros_rcl.libs").mkdir(parents=True)
    return tmp_path


@pytest.fixture
def export(prefix):
    file = prefix / "share/std_msgs/cmake/export_std_msgs__rosidl_generator_pyExport.cmake"
    file.parent.mkdir(parents=True)
    file.write_text(AS_BUILT)
    return file


@pytest.fixture
def sourced(mend_wheels, prefix):
    """The environment of a shell after sourcing the set-up script so often, as ``sourced(shell, times)``."""
    mend_wheels.write_local_setup(prefix)

    def environment(shell, times=1):
        script = f'. "{prefix}/local_setup.{shell}"; ' * times + "env"
        lines = subprocess.run([shell, "-uc", script], env={"PATH": "/usr/bin:/bin"}, capture_output=True, text=True)
        return dict(line.split("=", 1) for line in lines.stdout.splitlines())

    return environment


def test_header_paths_of_the_building_machine_become_ours(mend_wheels, prefix, export):
    mend_wheels.mend_header_paths(prefix, PYTHON_HEADERS, NUMPY_HEADERS)
    assert export.read_text() == EXPORT.format(f"{PYTHON_HEADERS};{NUMPY_HEADERS}")


def test_mending_header_paths_again_changes_nothing(mend_wheels, prefix, export):
    mend_wheels.mend_header_paths(prefix, PYTHON_HEADERS, NUMPY_HEADERS)
    mended = export.stat().st_mtime_ns
    mend_wheels.mend_header_paths(prefix, PYTHON_HEADERS, NUMPY_HEADERS)
    assert export.stat().st_mtime_ns == mended


@pytest.mark.parametrize("shell", ["sh", "bash"])
def test_sourcing_puts_the_environment_on_every_path(sourced, prefix, shell):
    environment = sourced(shell)
    assert environment["PATH"] == f"{prefix}/bin:/usr/bin:/bin"
    assert environment["AMENT_PREFIX_PATH"] == environment["CMAKE_PREFIX_PATH"] == str(prefix)
    assert environment["LD_LIBRARY_PATH"] == f"{prefix}/lib:{prefix}/lib/python3.11/site-packages/ros_rcl.libs"


@pytest.mark.parametrize("shell", ["sh", "bash"])
def test_sourcing_again_changes_nothing(sourced, shell):
    assert sourced(shell, times=2) == sourced(shell)


@pytest.mark.parametrize("shell", ["sh", "bash"])
def test_sourcing_keeps_python_from_starting_twice(sourced, shell):
    assert sourced(shell)["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] == "1"


def test_colcon_is_kept_out(mend_wheels, prefix):
    mend_wheels.hide_from_colcon(prefix)
    assert (prefix / "COLCON_IGNORE").exists()
