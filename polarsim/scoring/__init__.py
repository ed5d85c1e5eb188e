"""How good a run is: what compares with truth or with people's labels; nothing else reads those."""
