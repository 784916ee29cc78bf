"""Columns that the tables of several experiments have."""

from __future__ import annotations

from lipmotion.experiments.report.table import Column

ACC = Column("acc", "ACC", ".3f", "correlation of the opening with the recording")
NRMSE = Column("nrmse", "nRMSE", ".3f")
SCORE = Column("score", "score", ".1f", "closings of the recording that the motion makes within two frames, in %")
PRECISION = Column("precision", "precision", ".1f", "generated closings that are of the recording, in %")
RECALL = Column("recall_p_b_m", "p b m", ".1f", "p, b and m in which the lips close, in %")
VARIANCE = Column("global_variance", "variance", ".2f", "of the opening, by that of the recording")
JERK = Column("jerk", "jerk", ".2f", "of the opening, by that of the recording")
ELSEWHERE = Column("false_per_minute", "elsewhere", ".1f", "closings outside p, b and m, a minute of speech")
OPENING = (ACC, NRMSE, SCORE, PRECISION, RECALL, VARIANCE)
"""What the experiments that no paper printed say of the opening."""
