"""The robot file that a diagnosis writes, and what it says of the recordings."""
