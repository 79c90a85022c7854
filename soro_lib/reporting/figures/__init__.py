"""One module per paper, one function per figure, named after the paper's number for it."""
