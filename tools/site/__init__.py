"""The documentation as a site (`make docs`): what Sphinx does not do by itself, an idea a file.

public          the modules of the reference, and the names that each of them offers
docstrings      docstrings of this repository -> reStructuredText
benchmarks      speed by version
films           films that play within a page
sections        parts of a page
tasks           the page of a task: its class, and its scores
signatures      signatures as they are written
commands        the command line reference, from the parser
pages           Markdown that is filled in as a page is read: the reference, and links that leave docs
"""
