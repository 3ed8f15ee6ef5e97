# docker build -t missing-physics .
# docker run --rm -v "$PWD:/work" missing-physics diagnose arm.urdf run1.csv --out found
FROM python:3.12-slim

# A C compiler makes the reference engine several times faster; without one it runs as well.
RUN apt-get update \
    && apt-get install -y --no-install-recommends gcc libc6-dev libgl1 \
    && rm -rf /var/lib/apt/lists/*
COPY . /source
RUN pip install --no-cache-dir -c /source/constraints.txt "/source[bags]" && rm -rf /source
WORKDIR /work
ENTRYPOINT ["missing-physics"]
