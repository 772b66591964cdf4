"""The script ./aerial, on a made-up checkout where nothing is downloaded or built."""

ALL_STEPS = ["venv", "pip", "mend", "build"]


def test_the_first_call_makes_everything_in_order(checkout):
    checkout.call("plan")
    assert checkout.steps() == ALL_STEPS


def test_the_version_is_told_without_setting_up(checkout):
    assert checkout.call("--version").stdout == "aerial 0.0.7\n"
    assert checkout.steps() == []


def test_the_second_call_makes_nothing(checkout):
    checkout.call("plan")
    checkout.steps()
    checkout.call("plan")
    assert checkout.steps() == []


def test_changed_requirements_are_installed_into_the_same_environment(checkout):
    checkout.call("plan")
    checkout.steps()
    (checkout.top / "requirements.txt").write_text("numpy==2.4.5\n")
    checkout.call("plan")
    assert checkout.steps() == ["pip", "mend"]


def test_a_changed_manifest_only_rebuilds_the_workspace(checkout):
    checkout.call("plan")
    checkout.steps()
    checkout.manifest.write_text("<package></package>")
    checkout.call("plan")
    assert checkout.steps() == ["build"]


def test_a_new_message_rebuilds_the_workspace(checkout):
    checkout.call("plan")
    checkout.steps()
    (checkout.manifest.parent / "msg").mkdir()
    (checkout.manifest.parent / "msg/New.msg").touch()
    checkout.call("plan")
    assert checkout.steps() == ["build"]


def test_a_moved_checkout_is_set_up_anew(checkout):
    checkout.call("plan")
    checkout.steps()
    checkout.top = checkout.top.rename(checkout.top.with_name("moved"))
    checkout.call("plan")
    assert checkout.steps() == ALL_STEPS


def test_an_environment_without_its_python_is_made_anew(checkout):
    checkout.call("plan")
    checkout.steps()
    (checkout.top / ".venv/bin/python").unlink()
    checkout.call("plan")
    assert checkout.steps() == ALL_STEPS


def test_a_workspace_built_on_another_ros_is_built_anew(checkout):
    checkout.call("plan")
    checkout.steps()
    (checkout.top / "ros_ws/install/setup.sh").write_text("# built on /opt/ros/jazzy\n")
    checkout.call("plan")
    assert checkout.steps() == ["build"]


def test_a_failed_step_shows_its_output_and_says_what_to_do(checkout):
    call = checkout.call("plan", NO_SPACE="1")
    assert call.returncode == 1
    assert "no space left on device" in call.stderr
    assert "making the environment failed. Name another Python with AERIAL_PYTHON" in call.stderr


def test_the_call_after_a_failed_step_starts_over(checkout):
    checkout.call("plan", NO_SPACE="1")
    checkout.steps()
    assert checkout.call("plan").returncode == 0
    assert checkout.steps() == ALL_STEPS


def test_an_unfit_python_is_refused_with_what_to_install(checkout):
    call = checkout.call("plan", AERIAL_PYTHON="/bin/false")
    assert call.returncode == 1
    assert "a Python 3.11 to 3.14 with its headers is needed" in call.stderr
    assert "sudo apt install python3-dev python3-venv" in call.stderr


def test_a_path_with_a_space_is_refused(checkout):
    checkout.top = checkout.top.rename(checkout.top.with_name("my checkout"))
    call = checkout.call("plan")
    assert call.returncode == 1
    assert "move the checkout to a plain path" in call.stderr


def test_standard_output_belongs_to_the_command(checkout):
    first, second = checkout.call("plan"), checkout.call("plan")
    assert first.stdout == second.stdout


def test_the_caller_s_ros_and_python_paths_do_not_leak_in(checkout):
    call = checkout.call("plan", PYTHONPATH="/elsewhere", AMENT_PREFIX_PATH="/opt/ros/jazzy", OMP_NUM_THREADS="")
    assert call.stdout == "python path: , ament path: , threads: 1\n"


def test_run_passes_arguments_to_the_executable(checkout):
    assert checkout.call("run", "aerial_sim", "sim_node", "--ros-args").stdout == "sim_node --ros-args\n"


def test_run_names_the_executables_that_exist(checkout):
    call = checkout.call("run", "aerial_sim", "simulate")
    assert call.returncode == 2
    assert call.stdout == ""
    assert "no executable simulate in a package aerial_sim; there are\n  aerial_sim sim_node\n" in call.stderr


def test_it_works_through_a_symbolic_link(checkout):
    link = checkout.tools / "aerial"
    link.symlink_to(checkout.top / "aerial")
    assert checkout.call("run", "aerial_sim", "sim_node", command=link).returncode == 0
