"""Small dense computations, compiled once per machine by numba.

A *kernel* is a plain function of numbers and arrays that writes its results into arrays it is given
(:func:`mobman.kernels.kernel.kernel`); it holds an equation once, in the paper's symbols, and runs
compiled or, with ``NUMBA_DISABLE_JIT=1``, as the Python that it is. A *program* is a sequence of
kernels whose arguments are fixed beforehand (:func:`mobman.kernels.program.program`): one call from
Python, nothing unpacked, nothing allocated.
"""
