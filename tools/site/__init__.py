"""The documentation as a site (`make docs`): additions to Sphinx, an idea a file.

- public: the modules of the reference and their public names;
- docstrings: docstrings for Napoleon;
- benchmarks: speed by version;
- films: films that play within a page;
- sections: parts of a page;
- tasks: the page of a task;
- settings: the page of a diagnosis' settings;
- commands: the command line reference, from the parser;
- pages: Markdown that is filled in as a page is read.
"""
