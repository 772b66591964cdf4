"""Tasks and their null-space hierarchy, thesis (3.20)-(3.29)."""

from aerial_wbic.tasks.hierarchy import Task
from aerial_wbic.tasks.limbs import Joints, Limbs
from aerial_wbic.tasks.ordering import TaskKind, TaskOrdering, task_ordering
from aerial_wbic.tasks.tasks import command

__all__ = ["Joints", "Limbs", "Task", "TaskKind", "TaskOrdering", "command", "task_ordering"]
