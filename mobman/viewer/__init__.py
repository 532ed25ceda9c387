"""Looking at robots and runs: in the browser, as one page that opens offline, as pictures and film."""
