from setuptools import find_packages, setup

PACKAGE = "aerial_sim"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="From joint torques to measurements: the robot and its world in MuJoCo.",
    maintainer="Aerial maintainers",
    maintainer_email="maintainers@aerial.invalid",
    license="Apache-2.0",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    entry_points={"console_scripts": ["sim_node = aerial_sim.ros.sim_node:main"]},
    package_data={PACKAGE: ["py.typed"]},
    zip_safe=False,
)
