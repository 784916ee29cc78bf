"""The measures of quality that docs/measures.md defines: functions of arrays that return numbers."""
