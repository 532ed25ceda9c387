"""A suite from Python, its results as a pandas frame, and the runs of one cell beside each other."""

import tempfile
from concurrent.futures import ThreadPoolExecutor

import mobman as mm


def main(picture="suite_pandas.svg", duration=5.0):
    laws = ("tsm", "time-delay", "extended-jacobian")
    suite = mm.Suite.model_validate(
        {
            "schema": 1,
            "name": "mine",
            "duration": duration,
            "controllers": {law: {"law": law} for law in laws},
            "groups": [
                {
                    "robots": ["youbot", "husky_ur5"],
                    "tasks": ["circle"],
                    "scenarios": ["nominal", "heavier"],
                }
            ],
        }
    )
    with tempfile.TemporaryDirectory() as folder:
        with ThreadPoolExecutor(1) as pool:  # or none: processes, one for each core
            mm.run_suite(suite, folder, executor=pool, report=False)
        frame = mm.load_results(folder)
        print(frame.pivot_table("task_error_final", ["robot", "scenario"], "controller"))
        cell = frame[(frame.robot == "husky_ur5") & (frame.scenario == "heavier")]
        mm.compare(dict(zip(cell.controller, cell.file, strict=True))).plot(picture)


if __name__ == "__main__":
    main()
