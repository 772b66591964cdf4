from setuptools import find_packages, setup

PACKAGE = "aerial_wbic"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="From a plan and measurements to joint torques, 500 times a second.",
    maintainer="Aerial maintainers",
    maintainer_email="maintainers@aerial.invalid",
    license="Apache-2.0",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    package_data={PACKAGE: ["py.typed", "gains.yaml"]},
    entry_points={"console_scripts": ["wbic_node = aerial_wbic.ros.wbic_node:main"]},
    zip_safe=False,
)
