from setuptools import find_packages, setup

PACKAGE = "aerial_operator"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="What a person touches: the command line, selections, recordings.",
    maintainer="Aerial maintainers",
    maintainer_email="maintainers@aerial.invalid",
    license="Apache-2.0",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    entry_points={"console_scripts": ["aerial = aerial_operator.__main__:main"]},
    package_data={PACKAGE: ["py.typed"]},
    zip_safe=False,
)
