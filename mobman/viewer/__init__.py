"""Robots and runs shown in the browser, as one page that opens offline, as pictures and films."""
