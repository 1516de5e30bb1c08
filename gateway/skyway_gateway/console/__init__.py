"""The console: a page for operators, providers and customers, and the files that it needs.

`console_files` reads them once, `page_routes` serves them.
"""
