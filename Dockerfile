# A flight in a container:  docker build -t ares . && docker run --rm ares fly
# Pages and bags come out through a folder:  docker run --rm -v "$PWD/out:/ares/bags" ares fly

FROM python:3.12-slim-bookworm AS tools
RUN apt-get update \
    && DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends \
        chromium g++ gcc git make \
    && rm -rf /var/lib/apt/lists/*

FROM tools
WORKDIR /ares
COPY . .
RUN ./ares prepare
ENTRYPOINT ["./ares"]
CMD ["fly"]
