"""Pictures of a result, on the page of its report and as files: from its document alone; ``pictures`` has them all."""
