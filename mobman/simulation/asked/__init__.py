"""What a record keeps of a run that was asked for, and the way back to its parts; one part a file.

A part that a file cannot hold (an object of a class without a name, say) is noted with the reason, and
:mod:`mobman.simulation.repeat` refuses such a run in these words.
"""
