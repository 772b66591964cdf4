from setuptools import find_packages, setup

PACKAGE = "aerial_evaluation"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="The loop closed in one process: scenarios, campaigns, tables.",
    maintainer="Aerial maintainers",
    maintainer_email="maintainers@aerial.invalid",
    license="Apache-2.0",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    package_data={PACKAGE: ["py.typed", "bench/runs.yaml"]},
    zip_safe=False,
)
