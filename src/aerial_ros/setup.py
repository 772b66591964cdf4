from setuptools import find_packages, setup

PACKAGE = "aerial_ros"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="What every node of Aerial shares: its life, quality of service, messages from and to values.",
    maintainer="Aerial maintainers",
    maintainer_email="maintainers@aerial.invalid",
    license="Apache-2.0",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    package_data={PACKAGE: ["py.typed"]},
    zip_safe=False,
)
