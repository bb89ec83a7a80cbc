"""Sessions for development: ``nox`` runs tests, lint and types; ``docs`` builds the site, ``demo`` runs a suite."""

import nox

nox.options.sessions = ["tests", "lint", "types"]


@nox.session
def tests(session: nox.Session) -> None:
    """Run the test suite on both cores; arguments go to pytest."""
    session.install("-e", ".[colmap,theia,test]")
    session.run("python", "-m", "pytest", "-n", "auto", *session.posargs)


@nox.session
def lint(session: nox.Session) -> None:
    """Check style and format."""
    session.install("ruff>=0.17,<0.18")
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")


@nox.session
def types(session: nox.Session) -> None:
    """Check types, strictly."""
    session.install("-e", ".[test]")
    session.run("mypy", "bench", "methods", "datasets")


@nox.session
def docs(session: nox.Session) -> None:
    """Build the documentation in build/site, without network and with warnings as errors."""
    session.install("-e", ".[colmap,docs]")
    session.run("mkdocs", "build", "--strict", *session.posargs)


@nox.session
def demo(session: nox.Session) -> None:
    """Run the quick suite in a fresh environment, as a newcomer would."""
    session.install("-e", ".[colmap]")
    session.run("python", "-m", "bench", "run", *session.posargs)
