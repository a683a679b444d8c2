# docker build -t photostrip .
# docker run --rm -v "$PWD:/work" photostrip run project.yaml -o result --html
FROM python:3.12-slim
COPY pyproject.toml README.md LICENSE /source/
COPY photostrip /source/photostrip
RUN pip install --no-cache-dir /source
WORKDIR /work
ENTRYPOINT ["photostrip"]
