# The demo in a container: docker build -t mcap-landmarks . && docker run --rm -v "$PWD":/work mcap-landmarks demo -o demo
FROM python:3.12-slim

WORKDIR /src
COPY . .
RUN pip install --no-cache-dir -c requirements.lock . && rm -rf /src

# Outputs lie in the folder that is mounted there, and so do the logs that are read.
WORKDIR /work
ENTRYPOINT ["mcap-landmarks"]
CMD ["demo"]
