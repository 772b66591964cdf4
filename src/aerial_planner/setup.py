from setuptools import find_packages, setup

PACKAGE = "aerial_planner"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="From a motion and a goal to a checked plan.",
    maintainer="Aerial maintainers",
    maintainer_email="maintainers@aerial.invalid",
    license="Apache-2.0",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    package_data={PACKAGE: ["py.typed", "motions/*.yaml"]},
    entry_points={"console_scripts": ["planner_node = aerial_planner.ros.planner_node:main"]},
    zip_safe=False,
)
