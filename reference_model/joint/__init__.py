"""What joints have besides a motor, a bearing and the effects of the catalogue."""
