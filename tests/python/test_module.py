"""Tests of the Python module with the real program and the sample log.

`DCVINS` names the program, `PYTHONPATH` has the folder of the package; run by `tests/it/python.rs`.
"""

import gc
import os
import stat
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy

import dcvins
from dcvins import _program

ROOT = Path(__file__).resolve().parents[2]
LOG = ROOT / "sample_logs" / "garden.mcap"
#: Duration of the runs in seconds: the first window is at 2.6 s.
DURATION_S = 4.0


class Runs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.results = dcvins.run(LOG, ["auto", "classical"], duration=DURATION_S, timing=False)

    def test_runs_are_found_by_their_names(self):
        self.assertEqual(list(self.results), ["auto", "classical"])
        with self.assertRaisesRegex(KeyError, "no run 'static'; the runs are auto, classical"):
            self.results["static"]
        self.assertEqual(self.results.table()["columns"].tolist(), [18, 24])
        self.assertIsNone(self.results.stopped)

    def test_arrays_have_the_values_of_the_files(self):
        run = self.results["auto"]
        self.assertTrue(run.initialized)
        t_s, sigma = run.sigma("pitch.d")
        self.assertEqual(t_s.shape, sigma.shape)
        self.assertEqual(sigma[-1], run.parameters["sigma"][run.parameters["name"].tolist().index("pitch.d")])
        self.assertTrue(numpy.all(numpy.diff(t_s) > 0) and numpy.all(sigma > 0))
        lines = (run.folder / "trajectory.tum").read_text().splitlines()
        self.assertEqual(len(run.trajectory), len([line for line in lines if not line.startswith("#")]))
        self.assertEqual(run.trajectory.position_m[0].tolist(), [float(field) for field in lines[-len(t_s)].split()[1:4]])
        times, covariance = run.pose_covariance
        self.assertEqual(covariance.shape, (len(times), 6, 6))
        self.assertTrue(numpy.array_equal(covariance, covariance.transpose(0, 2, 1)))
        self.assertGreater(numpy.linalg.eigvalsh(covariance[-1]).min(), 0)
        self.assertTrue(numpy.array_equal(covariance[:, 0, 1], run.table("covariance")["x_y_m2"]))
        self.assertTrue(run.rig.is_file())

    def test_wrong_names_say_which_there_are(self):
        run = self.results["auto"]
        with self.assertRaisesRegex(dcvins.DcvinsError, "no parameter 'pitch.x'; its parameters are I.rx"):
            run.sigma("pitch.x")
        with self.assertRaisesRegex(dcvins.DcvinsError, "no table 'ranks'; a run has calibration"):
            run.table("ranks")
        with self.assertRaisesRegex(KeyError, "no column 'time'; the columns are t_s"):
            run.table("rank")["time"]

    def test_figures_are_svg(self):
        figure = self.results.figure("rank")
        self.assertTrue(figure._repr_svg_().startswith("<svg"))
        self.assertRegex(repr(figure), "^Figure: .*auto")
        with tempfile.TemporaryDirectory() as folder:
            figure.save(Path(folder) / "rank.svg")
            self.assertRaises(FileExistsError, figure.save, Path(folder) / "rank.svg")

    def test_evaluation_takes_files_and_trajectories(self):
        run = self.results["auto"]
        equal = dcvins.evaluate(run.trajectory, run.folder / "trajectory.tum", align="none")
        self.assertEqual((equal.pairs, equal.ate_m.max), (len(run.trajectory), 0.0))
        moved = run.trajectory
        moved = dcvins.Trajectory(moved.t_s, moved.position_m + [0.5, 0, 0], moved.quaternion_xyzw)
        self.assertAlmostEqual(dcvins.evaluate(moved, run.trajectory, align="none").ate_m.rmse, 0.5, places=9)

    def test_files_stay_only_with_a_folder(self):
        with tempfile.TemporaryDirectory() as folder:
            kept = dcvins.run(LOG, "auto", out=folder, start=1.0, duration=0.5)
            self.assertFalse(kept["auto"].initialized)
            self.assertIsNone(kept["auto"].ate_rmse_m)
            self.assertEqual(kept["auto"].table("calibration").rows, 0)
            reopened = dcvins.open_results(folder)
            self.assertEqual(list(reopened), ["auto"])
            with self.assertRaisesRegex(dcvins.DcvinsError, "have no log"):
                reopened.figure()
        # A run keeps its files without the results that it was taken from.
        only_run = dcvins.run(LOG, "auto", duration=0.5)["auto"]
        gc.collect()
        path = only_run.folder
        self.assertEqual(only_run.table("frames").rows, 10)
        del only_run
        gc.collect()
        self.assertFalse(path.exists())

    def test_a_condition_stops_a_run(self):
        stopped = dcvins.run(LOG, duration=DURATION_S, stop_when="features > 3").stopped
        self.assertEqual(stopped["run"], "auto")
        self.assertGreater(stopped["values"]["features"], 3)

    def test_a_required_accuracy_is_compared(self):
        loose = dcvins.run(LOG, duration=DURATION_S, require="translation=1m,rotation=90deg")["auto"]
        self.assertIn("within 1000 mm and 90°", loose.answer)
        with self.assertRaisesRegex(dcvins.DcvinsError, "is no positive number"):
            dcvins.run(LOG, require="translation=0mm")

    def test_frames_need_pandas(self):
        table = self.results["auto"].verdicts
        self.assertEqual(list(table.frame()["name"]), table["name"].tolist())
        with mock.patch.dict(sys.modules, {"pandas": None}):
            with self.assertRaisesRegex(dcvins.MissingPackage, "needs the package pandas.*pip install pandas"):
                table.frame()
            self.assertIsNone(table._repr_html_())


class OtherCommands(unittest.TestCase):
    def test_a_check_has_findings(self):
        found = dcvins.check(LOG)
        self.assertEqual((found.trust, found.errors), ("trusted", ()))
        self.assertIn("/imu", found.topics["topic"].tolist())
        self.assertIn("<table>", found._repr_html_())
        with tempfile.TemporaryDirectory() as folder:
            rig = Path(folder) / "bad.rig.yaml"
            rig.write_text((ROOT / "sample_logs" / "garden.rig.yaml").read_text().replace("/imu", "/imx"))
            self.assertTrue(dcvins.check(LOG, rig=rig).errors)

    def test_a_flight_is_simulated_and_calibrated(self):
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / "flight.mcap"
            flight = dcvins.simulate("T1", log, duration=0.5, size=(160, 120), seed=3, disturb={"readout": 0.01})
            self.assertTrue(flight.log.is_file() and flight.rig.is_file() and flight.truth.is_file())
            with self.assertRaisesRegex(dcvins.CommandFailed, "T9"):
                dcvins.simulate("T9", log)
        calibration = dcvins.calibrate(LOG)
        self.assertIn("pitch.d", calibration.parameters["name"].tolist())
        self.assertIn("pitch.d", calibration.report)
        self.assertTrue(calibration.rig.is_file())

    def test_a_study_has_tables(self):
        with tempfile.TemporaryDirectory() as folder:
            plan = Path(folder) / "plan.toml"
            plan.write_text(f'specs = ["auto"]\n[[logs]]\npath = "{LOG}"\nduration_s = 3.5\n[output]\nframes = true\n')
            study = dcvins.sweep(plan, Path(folder) / "study", jobs=1)
            self.assertEqual((study.runs["status"].tolist(), study.json["done"]), (["ok"], 1))
            self.assertEqual(study.parameters.rows, 18)
            self.assertTrue(study.figure("runs").svg.startswith("<svg"))
            self.assertEqual(repr(dcvins.open_study(study.folder)), repr(study))
        with self.assertRaisesRegex(dcvins.DcvinsError, "no study"):
            dcvins.open_study(ROOT)


class Program(unittest.TestCase):
    def test_errors_are_those_of_the_program(self):
        with self.assertRaises(dcvins.CommandFailed) as raised:
            dcvins.run("missing.mcap")
        self.assertEqual(raised.exception.exit_code, 1)
        self.assertRegex(str(raised.exception), r"^cannot open the log.*missing\.mcap$")
        with self.assertRaises(dcvins.CommandFailed) as raised:
            dcvins.run(LOG, "autos")
        self.assertEqual(raised.exception.exit_code, 2)
        self.assertRegex(str(raised.exception), r"unknown run 'autos'.*cluster$")

    def test_options_are_arguments(self):
        given = _program.options(from_=-1.5, max_difference=0.1, json=True, mcap=False, rig=None, run=["a", "b"])
        self.assertEqual(given, ["--from=-1.5", "--max-difference=0.1", "--json", "--run=a", "--run=b"])

    def test_the_program_is_found(self):
        self.assertRegex(dcvins.program_version(), r"^\d+\.\d+\.\d+")
        with tempfile.TemporaryDirectory() as folder, mock.patch.dict(os.environ, {"PATH": folder}):
            with mock.patch.object(_program, "_beside_the_package", lambda: iter([Path(folder) / "scripts" / "dcvins"])):
                del os.environ["DCVINS"]
                self.assertRaisesRegex(dcvins.ProgramNotFound, "set DCVINS to the path", dcvins.find_program)
                for place in (Path(folder) / "dcvins", Path(folder) / "scripts" / "dcvins"):
                    place.parent.mkdir(exist_ok=True)
                    place.write_text("#!/bin/sh\n")
                    place.chmod(place.stat().st_mode | stat.S_IXUSR)
                    self.assertEqual(dcvins.find_program(), str(place))
                os.environ["DCVINS"] = str(Path(folder) / "none")
                self.assertRaisesRegex(dcvins.ProgramNotFound, "is no program", dcvins.find_program)


if __name__ == "__main__":
    unittest.main()
