"""The command line, the page's server, emulators."""
